"""The jobs of a soak: scenes, tiles, targets and priorities as they come, each compared with an undisturbed render."""

import json
import shutil
import signal
import threading
import time
from pathlib import Path

# Scene, width, height, samples: one to four seconds of one processor each.
KINDS = [
    ('cornell', 64, 48, 64), ('cornell', 48, 48, 128), ('sphere', 64, 64, 32), ('cloud', 48, 32, 16), ('milk', 40, 30, 16), ('fog', 48, 32, 32),
    ('fire', 40, 40, 16), ('effects', 48, 32, 16)
]
TARGETS = [('cornell', 64, 64, '8%', 64), ('fog', 64, 48, '10%', 64)]
STUCK_SECONDS = 300
# A client that has begun to wait for a job goes on by itself, however often the coordinator is away.
BEGUN_SECONDS = 40


class Job:
    def __init__(self, farm, scenes, number, seed, chosen):
        self.farm, self.number, self.name = farm, number, f'soak-{seed}-{number}'
        self.folder = farm.folder / f'job-{number}'
        self.folder.mkdir()
        self.render = self._settings(scenes, chosen)
        self.submit = [
            *self.render, '--name', self.name, '--priority', str(chosen.randint(-5, 5)), '--user', chosen.choice(['ada', 'ben', 'cleo']), '--tile',
            str(chosen.choice([0, 8, 16, 32]))
        ]
        self.by = chosen.choice(['submit', 'watch', 'watch'])
        self.job_id, self.equal, self.spoil = None, False, False
        self.thread = threading.Thread(target=self._run, name=self.name, daemon=True)

    def _settings(self, scenes, chosen):
        if self.number % 5 == 4:
            scene, width, height, error, most = chosen.choice(TARGETS)
            self.samples = None
            amount = ['--target-error', error, '--max-spp', str(most)]
        else:
            scene, width, height, samples = chosen.choice(KINDS)
            self.samples = width * height * samples
            amount = ['--spp', str(samples)]
        return [str(scenes / f'{scene}.pbrt'), '--resolution', f'{width}x{height}', '--seed', str(1000 + self.number), *amount]

    def start(self):
        self.thread.start()

    def ended(self):
        return not self.thread.is_alive()

    def _run(self):
        try:
            self.equal = self._live()
        except Exception as error:  # whatever it is, the soak has not shown what it is for
            self.farm.problem(f'{self.name}: {error!r}')
        if self.equal:
            shutil.rmtree(self.folder, ignore_errors=True)

    def _live(self):
        deadline = time.monotonic() + STUCK_SECONDS
        if self.by == 'submit':
            code, _, complaint = self._wait(['submit', *self.submit, '-o', 'submitted.exr'], deadline)
            if code == 0 and not self._is_reference('submitted.exr'):
                return False
            if code not in (0, None, -signal.SIGKILL) and not self.farm.may_try_again(code, complaint):
                return self._wrong(f'submit -o ended with code {code}: {complaint.strip()[-500:]}')
        self.job_id = self._find() or self._submit()
        if self.job_id is None or not self._watch(deadline):
            return False
        if self.farm.ask(['fetch', self.job_id, '-o', 'fetched.exr'], self.folder) is None:
            return False
        return self._counts_are_right() and self._is_reference('fetched.exr')

    def _wrong(self, what):
        self.farm.problem(f'{self.name} ({" ".join(Path(word).name for word in self.submit)}): {what}')
        return False

    def _wait(self, words, deadline):
        return self.farm.run(words, self.folder, max(5.0, deadline - time.monotonic()), waits=True)

    def _find(self):
        """Its id, where the coordinator knows it by its name: the client that submitted it may have been killed."""
        jobs = self.farm.ask(['jobs', '--json'], self.folder)
        return None if jobs is None else next((job['job_id'] for job in json.loads(jobs)['jobs'] if job['name'] == self.name), None)

    def _submit(self):
        out = self.farm.ask(['submit', *self.submit], self.folder)
        return out.split('\n')[0] if out else None

    def _watch(self, deadline):
        while time.monotonic() < deadline:
            begin = time.monotonic()
            code, _, complaint = self._wait(['watch', self.job_id], deadline)
            if code == 0:
                return True
            if code == -signal.SIGKILL:
                continue
            if code is not None and time.monotonic() - begin > BEGUN_SECONDS:
                return self._wrong(f'watch gave up after {time.monotonic() - begin:.0f} s with code {code}: {complaint.strip()[-500:]}')
            if not self.farm.may_try_again(code, complaint):
                return self._wrong(f'watch ended with code {code}: {complaint.strip()[-500:]}')
            time.sleep(0.5)
        return self._wrong(f'has not ended after {STUCK_SECONDS} s: {self.farm.ask(["show", self.job_id, "--json"], self.folder)}')

    def _counts_are_right(self):
        shown = self.farm.ask(['show', self.job_id, '--json'], self.folder)
        if shown is None:
            return False
        job = json.loads(shown)
        progress = job['progress']
        if job['state'] != 'done' or progress['tasks_leased'] or progress['samples_in_flight'] or progress['tasks_failed']:
            return self._wrong(f'ended as {shown}')
        if progress['samples_done'] != progress['samples_total'] or self.samples not in (None, progress['samples_done']):
            return self._wrong(f'has {progress["samples_done"]} samples of {progress["samples_total"]}, expected {self.samples}')
        return True

    def _is_reference(self, picture):
        """Picture and nodes have the bytes that `woodcock render` gives them."""
        reference = self.folder / 'reference.exr'
        if not reference.exists():
            code, _, complaint = self.farm.run(['render', *self.render, '--threads', '1', '-o', 'reference.exr'], self.folder, STUCK_SECONDS)
            if code != 0:
                return self._wrong(f'its reference cannot be rendered: {complaint.strip()[-500:]}')
        for suffix in ('.exr', '.nodes.exr'):
            path = (self.folder / picture).with_suffix(suffix)
            found = bytearray(path.read_bytes())
            if self.spoil:
                found[len(found) // 2] ^= 1
            if bytes(found) != reference.with_suffix(suffix).read_bytes():
                return self._wrong(f'{path} is not {reference.with_suffix(suffix)}')
        return True
