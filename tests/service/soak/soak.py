#!/usr/bin/env python3
"""Faults every few seconds on a farm of real programs, job after job. Each picture must be that of an undisturbed render, to the bit, and
nothing may be left over or grow. A line a minute, a report at the end. Exit codes: 0 nothing is wrong, 1 something is, 2 wrong usage."""

import argparse
import json
import os
import signal
import socket
import sqlite3
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import processes  # noqa: E402
from farm import Farm, chosen_by  # noqa: E402
from faults import Faults  # noqa: E402
from jobs import Job  # noqa: E402

MIB = 1 << 20
# What may be there beyond what was at the beginning.
GROWTH_OF_COORDINATOR, GROWTH_OF_WORKER = 48 * MIB, 24 * MIB  # while it lives, of what it had soon after half time
MORE_DESCRIPTORS, MORE_THREADS = 16, 32
MOST_CHILD = 1024 * MIB  # of one render process
MOST_LOGS, MOST_ASSETS = 220, 200
# Things that --spoil does, so that one sees what the soak notices.
SPOILS = ['picture', 'child', 'file', 'descriptors', 'memory', 'program', 'samples']


def say(text):
    print(text, flush=True)


class Soak:
    def __init__(self, arguments, folder):
        self.arguments = arguments
        self.farm = Farm(arguments.bin, folder, arguments.workers, chosen_by(arguments.seed, 'farm'))
        self.faults = Faults(self.farm, chosen_by(arguments.seed, 'faults'))
        self.moments, self.choices = chosen_by(arguments.seed, 'moments'), chosen_by(arguments.seed, 'jobs')
        self.jobs, self.samples, self.held = [], [], []
        self.told_more = 0  # bytes that are said of the coordinator beyond what it has
        self.began = time.monotonic()
        self.quiet = {}

    def minutes(self):
        return (time.monotonic() - self.began) / 60

    def steady(self):
        """The coordinator lives from half time on, so that its memory can be watched."""
        return self.minutes() >= self.arguments.minutes / 2

    # --- the loop ----------------------------------------------------------------------------------------------------

    def run(self):
        self.farm.start()
        for number in range(self.arguments.workers):  # each renders once, so that what is loaded then is there
            self._next_job()
        self._wait_for_jobs()
        self.quiet = self._quiet()
        say(f'{len(self.jobs)} jobs undisturbed; now faults: {", ".join(self.faults.names(steady=False))}')
        if self.faults.skipped:
            say(f'skipped, since they need root: {", ".join(self.faults.skipped)}')
        self.began = time.monotonic()
        next_fault, next_sample, next_line, spoilt = time.monotonic() + 2, 0.0, 1, self.arguments.spoil is None
        while self.minutes() < self.arguments.minutes:
            now = time.monotonic()
            self.faults.undo()
            self.farm.look_after()
            if now >= next_fault:
                self.faults.one(self.steady())
                next_fault = time.monotonic() + self.moments.uniform(2, 6)
            if sum(not job.ended() for job in self.jobs) < 2:
                self._next_job()
            if now >= next_sample:
                self._sample()
                next_sample = now + 5
            if not spoilt and self.minutes() >= self.arguments.minutes * 0.6:
                spoilt = True
                self._spoil()
            if self.minutes() >= next_line:
                self._line(f'{next_line} min')
                next_line += 1
                self._retain()
            time.sleep(0.1)
        self.faults.undo(everything=True)
        self._wait_for_jobs()
        self._check_end()
        self._line('end')
        return self._report()

    def _next_job(self):
        job = Job(self.farm, self.arguments.scenes, len(self.jobs), self.arguments.seed, self.choices)
        self.jobs.append(job)
        job.start()

    def _wait_for_jobs(self):
        while any(not job.ended() for job in self.jobs):
            self.faults.undo()
            self.farm.look_after()
            time.sleep(0.2)

    def _retain(self):
        """Lets old jobs go, as the coordinator does every ten minutes."""
        folder = self.farm.folder / 'retain'
        folder.mkdir(exist_ok=True)
        self.farm.run(['retain'], folder)  # a coordinator that is away now is asked again in a minute

    # --- what it holds -----------------------------------------------------------------------------------------------

    def _sample(self):
        children, _ = processes.tree()
        sample = {'minutes': self.minutes(), 'steady': self.steady(), 'files': processes.files_below(self.farm.coordinator.folder)}
        for program in self.farm.programs:
            if not program.running():
                continue
            below = processes.below(program.pid, children)
            more = self.told_more if program is self.farm.coordinator else 0
            sample[program.name] = {
                'start': program.starts, 'bytes': processes.resident_bytes(program.pid) + more, 'descriptors': processes.count(program.pid, 'fd'),
                'threads': processes.count(program.pid, 'task'), 'children': len(below),
                'child_bytes': max([processes.resident_bytes(pid) for pid in below], default=0)
            }
        self.samples.append(sample)
        self.farm.check_orphans()

    def _quiet(self):
        """Descriptors and threads without any job, and without clients."""
        time.sleep(6)
        self._sample()
        return self.samples[-1]

    def _line(self, when):
        sample, done = self.samples[-1], sum(job.equal for job in self.jobs)
        parts = [f'{when}: {done} jobs equal, {sum(not job.ended() for job in self.jobs)} under way, {sum(self.faults.counts.values())} faults, '
                 f'{len(self.farm.problems)} problems; {sample["files"][0]} files of {sample["files"][1] / MIB:.1f} MiB']
        for program in self.farm.programs:
            if now := sample.get(program.name):
                parts.append(f'{program.name} (start {now["start"]}) {now["bytes"] / MIB:.0f} MiB, {now["descriptors"]} descriptors, '
                             f'{now["threads"]} threads, {now["children"]} children')
        say('; '.join(parts))

    # --- the end -----------------------------------------------------------------------------------------------------

    def _check_end(self):
        farm, folder = self.farm, self.farm.folder / 'end'
        folder.mkdir()
        if self.held:
            self._hold_connections()  # the coordinator has ended those that said nothing for 20 s
        self._check_growth(self._quiet())
        workers = json.loads(farm.ask(['workers', '--json'], folder) or '{"workers": []}')['workers']
        for worker in workers:
            if worker['leases']:
                farm.problem(f'worker {worker["worker_id"]} has {worker["leases"]} leases after the last job')
        for job in json.loads(farm.ask(['jobs', '--json'], folder) or '{"jobs": []}')['jobs']:
            farm.ask(['delete', '--cancel', job['job_id']], folder)
        self._check_files(folder)
        farm.stop()
        time.sleep(1)
        left = [f'{pid} {processes.name_of(pid)}' for pid in processes.tree()[0].get(os.getpid(), [])]
        if left:
            farm.problem(f'processes are left behind: {"; ".join(left)}')
        with sqlite3.connect(farm.coordinator.folder / 'woodcock.sqlite') as database:
            said = database.execute('pragma integrity_check').fetchone()[0]
            if said != 'ok':
                farm.problem(f'the database is damaged: {said}')
            for table in ('jobs', 'frames', 'settled', 'results', 'leases', 'deletions'):
                rows = database.execute(f'select count(*) from {table}').fetchone()[0]
                if rows:
                    farm.problem(f'the database has {rows} rows of {table} after every job was deleted')

    def _check_growth(self, end):
        for name, limit in (('coordinator', GROWTH_OF_COORDINATOR), ('worker-1', GROWTH_OF_WORKER)):
            life = [s[name] for s in self.samples if name in s and s['steady'] and s[name]['start'] == end.get(name, {}).get('start')]
            if len(life) < 8:
                self.farm.problem(f'{name} was seen {len(life)} times since half time, expected 8: it cannot be said whether its memory grew')
                continue
            part = len(life) // 4
            before, after = (median(s['bytes'] for s in some) for some in (life[:part], life[-part:]))
            say(f'{name}: {before / MIB:.1f} MiB after half time, {after / MIB:.1f} MiB at the end')
            if after - before > limit:
                self.farm.problem(f'the memory of {name} grew from {before / MIB:.0f} to {after / MIB:.0f} MiB, expected at most {limit / MIB:.0f} more')
            for what, most in (('descriptors', MORE_DESCRIPTORS), ('threads', MORE_THREADS)):
                if end[name][what] > self.quiet[name][what] + most:
                    self.farm.problem(f'{name} has {end[name][what]} {what} at the end, and had {self.quiet[name][what]} before the faults')
        for program in self.farm.programs:
            seen = [s[program.name] for s in self.samples if program.name in s]
            children, most = max(s['children'] for s in seen), 4 if program is self.farm.coordinator else 3
            if children > most:
                self.farm.problem(f'{program.name} had {children} processes at once, expected at most {most}')
            if (largest := max(s['child_bytes'] for s in seen)) > MOST_CHILD:
                self.farm.problem(f'a process of {program.name} took {largest / MIB:.0f} MiB, expected at most {MOST_CHILD / MIB:.0f}')
        middle, last = ([s['files'][0] for s in self.samples if low <= s['minutes'] / self.arguments.minutes < high]
                        for low, high in ((0.25, 0.5), (0.75, 1.0)))
        say(f'files of the coordinator: at most {max(middle)} before half time, at most {max(last)} at the end')
        if max(last) > 2 * max(middle) + 200:
            self.farm.problem(f'the coordinator had {max(last)} files at once at the end, and at most {max(middle)} before half time')

    def _check_files(self, folder):
        """Nothing refers to anything any more: every file goes when the time of a pin is over."""
        farm = self.farm
        deadline = time.monotonic() + 90
        while (left := processes.files_below(farm.coordinator.folder / 'blobs')[0]) and time.monotonic() < deadline:
            farm.ask(['retain'], folder)
            time.sleep(3)
        for name in ('blobs', 'uploads', 'temporary'):
            if left := processes.files_below(farm.coordinator.folder / name)[0]:
                farm.problem(f'the coordinator has {left} files in {name} after every job was deleted')
        for worker in farm.workers:
            if left := processes.files_below(worker.folder / 'spool')[0]:
                farm.problem(f'{worker.name} has {left} results in its spool after the last job')
            for name, most in (('logs', MOST_LOGS), ('assets', MOST_ASSETS)):
                if (found := processes.files_below(worker.folder / name)[0]) > most:
                    farm.problem(f'{worker.name} has {found} files in {name}, expected at most {most}')

    def _report(self):
        farm, done = self.farm, sum(job.equal for job in self.jobs)
        if done < self.arguments.jobs:
            farm.problem(f'{done} jobs ended with the right picture, expected at least {self.arguments.jobs}')
        missing = [name for name in self.faults.names(steady=False) if not self.faults.counts.get(name)]
        if missing and self.arguments.minutes >= 4:
            farm.problem(f'faults that never met anything: {", ".join(missing)}')
        say(f'seed {self.arguments.seed}, {self.arguments.minutes:g} min: {done} of {len(self.jobs)} jobs have the bits of an undisturbed render')
        say('faults: ' + ', '.join(f'{name} {count}' for name, count in sorted(self.faults.counts.items())))
        say('clients tried again: ' + (', '.join(f'{words} {count}' for words, count in sorted(farm.retried.items())) or 'never'))
        say('starts: ' + ', '.join(f'{program.name} {program.starts}' for program in farm.programs))
        for problem in farm.problems:
            say(f'problem: {problem}')
        say(f'{len(farm.problems)} problems' + (f'; everything is in {farm.folder}' if farm.problems else ''))
        return 1 if farm.problems else 0

    # --- what it would notice ----------------------------------------------------------------------------------------

    def _hold_connections(self):
        port = int(self.farm.coordinator.words[self.farm.coordinator.words.index('--listen') + 1].rpartition(':')[2])
        self.held = [socket.create_connection(('127.0.0.1', port)) for _ in range(60)]

    def _spoil(self):
        what, farm = self.arguments.spoil, self.farm
        say(f'spoiling: {what}')
        if what == 'picture':
            for job in self.jobs:
                job.spoil = not job.ended()
        elif what == 'child':  # loses its parent at once
            subprocess.run(['sh', '-c', 'sleep 1000 > /dev/null 2>&1 &'], check=True)
        elif what == 'file':
            place = farm.coordinator.folder / 'blobs' / 'zz'
            place.mkdir()
            (place / ('0' * 64)).write_bytes(b'nobody refers to it, and no clean-up looks here')
        elif what == 'descriptors':
            self._hold_connections()
        elif what == 'memory':  # told, not taken: nothing that a client asks for takes so much
            self.told_more = GROWTH_OF_COORDINATOR + 16 * MIB
        elif what == 'program':
            farm.workers[-1].process.send_signal(signal.SIGKILL)
        elif what == 'samples':
            for job in self.jobs:
                job.samples = -1


def main():
    source = HERE.parent.parent.parent
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--minutes', type=float, default=30, help='how long there are faults')
    parser.add_argument('--seed', type=int, default=1, help='of the faults and the jobs')
    parser.add_argument('--workers', type=int, default=2, choices=range(2, 9), metavar='2..8', help='the first has two slots')
    parser.add_argument('--jobs', type=int, help='how many must end at least; two in three minutes without')
    parser.add_argument('--bin', type=Path, default=source / 'build/release/bin', help='folder of the three programs')
    parser.add_argument('--scenes', type=Path, default=source / 'scenes', help='folder of the scenes')
    parser.add_argument('--spoil', choices=SPOILS, help='spoil this after a while: the soak must notice')
    arguments = parser.parse_args()
    arguments.bin, arguments.scenes = arguments.bin.resolve(), arguments.scenes.resolve()
    if arguments.jobs is None:
        arguments.jobs = max(1, int(arguments.minutes * 2 / 3))
    missing = [name for name in ('woodcock', 'woodcock-worker', 'woodcock-coordinator') if not os.access(arguments.bin / name, os.X_OK)]
    if missing or not 0.2 <= arguments.minutes <= 10000:
        parser.error(f'{", ".join(missing)} missing in {arguments.bin}' if missing else '--minutes: expected 0.2 to 10000')
    soak = Soak(arguments, Path(tempfile.mkdtemp(prefix='woodcock-soak-')))
    try:
        code = soak.run()
    except BaseException:
        say(f'broken off; everything is in {soak.farm.folder}')
        raise
    if code == 0 or arguments.spoil:
        soak.farm.clean()
    sys.exit(code)


if __name__ == '__main__':
    main()
