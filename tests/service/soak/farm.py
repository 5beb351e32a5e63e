"""The farm of a soak: a coordinator, workers and the clients that ask for their pictures, as real programs in one folder."""

import os
import random
import re
import shutil
import signal
import socket
import subprocess
import threading
import time
from pathlib import Path

import processes
from proxies import Proxies

RESTART_SECONDS = 1.0  # between two starts of a program that ended on a full disk
# What a command may say that began while the coordinator was away, or had no room.
AWAY = ('no coordinator answers', 'disk is full', 'no room', 'UNAVAILABLE', 'DEADLINE_EXCEEDED', 'RESOURCE_EXHAUSTED')


def free_port(chosen):
    """A port below those that the system gives to outgoing connections, so that none takes it while the coordinator is away."""
    while True:
        port = chosen.randrange(20000, 30000)
        with socket.socket() as test:
            try:
                test.bind(('127.0.0.1', port))
                return port
            except OSError:
                continue


def last_lines(path, lines=8):
    try:
        return '\n'.join(path.read_text(errors='replace').splitlines()[-lines:])
    except OSError:
        return ''


class Program:
    """A coordinator or worker that is started again after each fault that ended it, and never ends by itself."""

    def __init__(self, name, words, folder, log):
        self.name, self.words, self.folder, self.log = name, words, folder, log
        self.process, self.again_at, self.starts, self.started_at = None, 0.0, 0, 0.0

    def start(self):
        with self.log.open('ab') as log:
            self.process = subprocess.Popen(self.words, stdin=subprocess.DEVNULL, stdout=log, stderr=log, preexec_fn=processes.end_with_parent,
                                            cwd=self.folder.parent)
        self.starts += 1
        self.started_at, self.again_at = time.monotonic(), None

    @property
    def pid(self):
        return self.process.pid if self.process else 0

    def running(self):
        return self.process is not None and self.process.poll() is None

    def end(self, number, pause):
        """Ends it by a signal; it is started again when it has ended and the pause is over."""
        self.again_at = time.monotonic() + pause
        self.process.send_signal(number)


class Disk:
    """A file system of its own for one program, which can be filled; an ordinary folder where that is not allowed."""

    def __init__(self, folder, mib, own):
        self.folder, self.own, self.full_until = folder, own, 0.0
        folder.mkdir()
        if own:
            subprocess.run(['mount', '-t', 'tmpfs', '-o', f'size={mib}m', 'tmpfs', str(folder)], check=True)

    def fill(self, seconds):
        self.full_until = time.monotonic() + seconds
        block = bytes(1 << 16)
        with (self.folder / 'ballast').open('wb', buffering=0) as ballast:
            try:
                while ballast.write(block):
                    pass
            except OSError:
                pass

    def free(self):
        (self.folder / 'ballast').unlink(missing_ok=True)
        self.full_until = 0.0

    def short(self):
        """Full, or so a moment ago: programs may end because of it."""
        return (self.folder / 'ballast').exists() or time.monotonic() < self.full_until + 5


class Farm:
    def __init__(self, programs, folder, workers, chosen):
        self.bin, self.folder = programs, folder
        self.problems, self.retried = [], {}
        self._lock, self._mine, self._strangers = threading.Lock(), set(), {}
        self.waiting_clients = {}  # pid → its process, of clients that wait for the end of a job
        own = processes.own_mounts()
        processes.adopt_orphans()
        self.disks = {'coordinator': Disk(folder / 'disk-coordinator', 192, own), 'worker-2': Disk(folder / 'disk-worker-2', 96, own)}
        self.can_fill = own
        self.proxies = Proxies()
        port = free_port(chosen)
        self.coordinator = self._program('coordinator', self.disks['coordinator'].folder, [
            'woodcock-coordinator', '--listen', f'127.0.0.1:{port}', '--lease', '4', '--grace', '2', '--min-free', '16', '--merges', '2', '--pin', '20',
            '--keep-jobs', '2min'])
        self.client_line, client_port = self.proxies.add(port)
        self.address = f'127.0.0.1:{client_port}'
        self.workers, self.worker_lines = [], []
        for number in range(1, workers + 1):
            name = f'worker-{number}'
            line, worker_port = self.proxies.add(port)
            place = self.disks[name].folder if name in self.disks else folder
            self.workers.append(self._program(name, place, [
                'woodcock-worker', '--coordinator', f'127.0.0.1:{worker_port}', '--threads', '1', '--slots', '2' if number == 1 else '1', '--drain', '3']))
            self.worker_lines.append(line)
        self.programs = [self.coordinator, *self.workers]

    def _program(self, name, place, words):
        folder = place / name
        folder.mkdir()
        return Program(name, [str(self.bin / words[0]), '--dir', str(folder), *words[1:]], folder, self.folder / f'{name}.log')

    def problem(self, text):
        with self._lock:
            self.problems.append(text)
        print(f'PROBLEM: {text}', flush=True)

    # --- programs ----------------------------------------------------------------------------------------------------

    def start(self):
        for program in self.programs:
            program.start()
        deadline = time.monotonic() + 120
        while not all((worker.folder / 'ready').exists() for worker in self.workers):
            dead = [program for program in self.programs if not program.running()]
            if dead or time.monotonic() > deadline:
                raise RuntimeError(f'the farm does not start: {", ".join(p.name for p in dead) or "no worker is ready"}\n' +
                                   '\n'.join(last_lines(p.log) for p in self.programs))
            time.sleep(0.1)

    def look_after(self):
        """Starts again what a fault ended. What ended by itself is a problem, once."""
        for program in self.programs:
            if program.running():
                continue
            now = time.monotonic()
            if program.again_at is None:
                disk = self.disks.get(program.name)
                if disk is None or not disk.short():
                    self.problem(f'{program.name} ended by itself with code {program.process.returncode}:\n{last_lines(program.log)}')
                program.again_at = now + RESTART_SECONDS
            elif now >= program.again_at:
                program.start()

    def stop(self):
        """Workers first, so that they hand in what they have. What does not heed is a problem."""
        for group in (self.workers, [self.coordinator]):
            for program in group:
                if program.running():
                    program.process.send_signal(signal.SIGCONT)
                    program.process.send_signal(signal.SIGTERM)
            for program in group:
                try:
                    if program.process.wait(60) != 0:
                        self.problem(f'{program.name} ended with code {program.process.returncode} when told to end:\n{last_lines(program.log)}')
                except subprocess.TimeoutExpired:
                    self.problem(f'{program.name} does not end within a minute of SIGTERM')
                    program.process.kill()
                    program.process.wait()

    def children(self, program):
        return processes.below(program.pid, processes.tree()[0]) if program.running() else []

    def check_orphans(self):
        """A process that lost its parent and is there ten seconds later is a problem."""
        children, zombies = processes.tree()
        with self._lock:
            known = self._mine | {program.pid for program in self.programs}
        now = time.monotonic()
        strangers = [pid for pid in children.get(os.getpid(), []) if pid not in known]
        self._strangers = {pid: self._strangers.get(pid, now) for pid in strangers}
        for pid, since in self._strangers.items():
            if since and now - since > 10:
                self.problem(f'process {pid} has lost its parent and goes on: {processes.name_of(pid)}')
                self._strangers[pid] = 0  # once
        for pid in zombies:
            if pid not in known:
                try:
                    os.waitpid(pid, os.WNOHANG)
                except ChildProcessError:
                    pass

    # --- clients -----------------------------------------------------------------------------------------------------

    def run(self, words, folder, patience=60.0, waits=False):
        """Runs `woodcock` to its end: (code, what it printed, what it complained of). One that waits for a job may be killed by a fault."""
        environment = dict(os.environ, WOODCOCK_COORDINATOR=self.address)
        with (folder / 'client.out').open('w+b') as out, (folder / 'client.err').open('w+b') as err:
            with self._lock:
                process = subprocess.Popen([str(self.bin / 'woodcock'), *words], stdin=subprocess.DEVNULL, stdout=out, stderr=err, cwd=folder,
                                           env=environment, preexec_fn=processes.end_with_parent)
                self._mine.add(process.pid)
                if waits:
                    self.waiting_clients[process.pid] = process
            try:
                code = process.wait(patience)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                code = None
            with self._lock:
                self._mine.discard(process.pid)
                self.waiting_clients.pop(process.pid, None)
            out.seek(0)
            err.seek(0)
            return code, out.read().decode(errors='replace'), err.read().decode(errors='replace')

    def ask(self, words, folder, patience=90.0):
        """Runs a short command, and again while the coordinator is away. What it printed, or None when that has not worked in time."""
        deadline = time.monotonic() + patience
        while True:
            code, out, err = self.run(words, folder)
            if code == 0:
                return out
            if not self.may_try_again(code, err):
                self.problem(f'woodcock {" ".join(words)} ended with code {code}: {err.strip()[-500:]}')
                return None
            if time.monotonic() > deadline:
                self.problem(f'woodcock {" ".join(words)} has not worked for {patience:.0f} s: {err.strip()[-500:]}')
                return None
            time.sleep(0.5)

    def may_try_again(self, code, complaint):
        """Whether a client that ended says that the coordinator was away, or its disk full."""
        known = next((words for words in AWAY if words in complaint), 'did not end in a minute' if code is None else None)
        if known is None:
            return False
        with self._lock:
            self.retried[known] = self.retried.get(known, 0) + 1
        return True

    # --- what it holds -----------------------------------------------------------------------------------------------

    def blobs(self, begin=b''):
        """The coordinator's files that begin so."""
        found = []
        for path in (self.coordinator.folder / 'blobs').rglob('*'):
            try:
                if path.is_file() and re.fullmatch('[0-9a-f]{64}', path.name) and path.open('rb').read(len(begin)) == begin:
                    found.append(path)
            except OSError:
                pass
        return found

    def clean(self):
        self.proxies.stop()
        for pid in processes.tree()[0].get(os.getpid(), []):  # left behind: it was told
            os.kill(pid, signal.SIGKILL)
        for disk in self.disks.values():
            if disk.own:
                subprocess.run(['umount', '--lazy', str(disk.folder)], check=False)
        shutil.rmtree(self.folder, ignore_errors=True)


def chosen_by(seed, purpose):
    """Random numbers of their own for each purpose."""
    return random.Random(f'{seed} {purpose}')
