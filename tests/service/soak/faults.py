"""What goes wrong in a soak. A fault is a function of the farm, random numbers and the list of what must be undone, and when."""

import os
import signal
import time

import processes


class Faults:
    """Does one after the other. `steady`: from then on nothing ends the coordinator, so that its memory can be watched."""

    def __init__(self, farm, chosen):
        self.farm, self.chosen, self.counts, self._undo = farm, chosen, {}, []
        ends_coordinator = [self.kill_coordinator, self.restart_coordinator, self.fill_coordinators_disk]
        self._needs_root = [self.fill_coordinators_disk, self.fill_workers_disk]
        self._all = [
            self.kill_worker, self.drain_worker, self.stop_worker, self.kill_render_child, self.stop_render_child, self.stop_coordinator, self.kill_merge,
            self.reset_worker, self.silence_worker, self.reset_clients, self.silence_clients, self.kill_client, self.truncate_cached_file,
            self.remove_cached_file, self.truncate_result, self.fill_workers_disk, *ends_coordinator
        ]
        self._steady = [fault for fault in self._all if fault not in ends_coordinator]
        self.skipped = [] if farm.can_fill else [self.name_of(fault) for fault in self._needs_root]

    @staticmethod
    def name_of(fault):
        return fault.__name__.replace('_', ' ').replace('coordinators', "coordinator's").replace('workers disk', "worker's disk")

    def names(self, steady):
        return [self.name_of(fault) for fault in self._allowed(steady)]

    def _allowed(self, steady):
        faults = self._steady if steady else self._all
        return [fault for fault in faults if self.farm.can_fill or fault not in self._needs_root]

    def one(self, steady):
        """Does a fault that has something to meet."""
        faults = self._allowed(steady)
        # Each kind comes as often as the others, whatever it finds.
        least = min(self.counts.get(self.name_of(fault), 0) for fault in faults)
        rare = [fault for fault in faults if self.counts.get(self.name_of(fault), 0) <= least + 1]
        for fault in self.chosen.sample(rare, len(rare)):
            if fault() is not False:
                self.counts[self.name_of(fault)] = self.counts.get(self.name_of(fault), 0) + 1
                return

    def undo(self, everything=False):
        """Undoes what is over."""
        now = time.monotonic()
        over = [entry for entry in self._undo if everything or entry[0] <= now]
        self._undo = [entry for entry in self._undo if entry not in over]
        for _, action in over:
            action()

    def _later(self, action, shortest=1.0, longest=9.0):
        """A lease is 4 s with 2 s of grace: some of these pauses are longer."""
        self._undo.append((time.monotonic() + self.chosen.uniform(shortest, longest), action))

    def _worker(self, mortal=False):
        """Any that runs. The first is never ended, so that its memory can be watched."""
        running = [worker for worker in self.farm.workers[1 if mortal else 0:] if worker.running()]
        return self.chosen.choice(running) if running else None

    def _pause(self):
        return self.chosen.choice([0.0, 0.5, 3.0, 7.0])

    def _stop(self, pid):
        try:
            process = os.pidfd_open(pid)
            signal.pidfd_send_signal(process, signal.SIGSTOP)
        except ProcessLookupError:
            return False

        def go_on():
            try:
                signal.pidfd_send_signal(process, signal.SIGCONT)
            except ProcessLookupError:
                pass
            os.close(process)

        self._later(go_on)
        return True

    # --- workers -----------------------------------------------------------------------------------------------------

    def kill_worker(self):
        worker = self._worker(mortal=True)
        return worker is not None and worker.end(signal.SIGKILL, self._pause())

    def drain_worker(self):
        worker = self._worker(mortal=True)
        return worker is not None and worker.end(signal.SIGTERM, self._pause())

    def stop_worker(self):
        worker = self._worker()
        return worker is not None and self._stop(worker.pid)

    def _render_child(self):
        worker = self._worker()
        children = self.farm.children(worker) if worker else []
        return self.chosen.choice(children) if children else None

    def kill_render_child(self):
        return self._kill(self._render_child())

    def stop_render_child(self):
        child = self._render_child()
        return child is not None and self._stop(child)

    @staticmethod
    def _kill(pid):
        try:
            return pid is not None and os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:
            return False

    def _cached_file(self):
        worker = self._worker()
        files = [path for path in (worker.folder / 'assets' / 'blobs').iterdir()] if worker and (worker.folder / 'assets/blobs').is_dir() else []
        return self.chosen.choice(sorted(files)) if files else None

    def truncate_cached_file(self):
        """Under the render child that has it mapped, too: the scene's folder has a link to the same bytes."""
        return self._truncate(self._cached_file())

    def remove_cached_file(self):
        path = self._cached_file()
        if path is None:
            return False
        path.unlink(missing_ok=True)
        return True

    def _truncate(self, path):
        try:
            if path is None or path.stat().st_size < 2:
                return False
            os.truncate(path, self.chosen.randrange(path.stat().st_size))
        except OSError:
            return False
        return True

    # --- the coordinator ---------------------------------------------------------------------------------------------

    def kill_coordinator(self):
        return self.farm.coordinator.running() and self.farm.coordinator.end(signal.SIGKILL, self._pause())

    def restart_coordinator(self):
        return self.farm.coordinator.running() and self.farm.coordinator.end(signal.SIGTERM, self._pause())

    def stop_coordinator(self):
        return self.farm.coordinator.running() and self._stop(self.farm.coordinator.pid)

    def kill_merge(self):
        children = self.farm.children(self.farm.coordinator)
        return self._kill(self.chosen.choice(children) if children else None)

    def truncate_result(self):
        """A tile or an image at rest."""
        results = sorted(self.farm.blobs(b'\x76\x2f\x31\x01'))
        return self._truncate(self.chosen.choice(results) if results else None)

    # --- the network, the disks, the clients -------------------------------------------------------------------------

    def reset_worker(self):
        self.farm.proxies.reset(self.chosen.choice(self.farm.worker_lines))

    def silence_worker(self):
        self.farm.proxies.silence(self.chosen.choice(self.farm.worker_lines), self.chosen.uniform(1, 12))

    def reset_clients(self):
        self.farm.proxies.reset(self.farm.client_line)

    def silence_clients(self):
        self.farm.proxies.silence(self.farm.client_line, self.chosen.uniform(1, 12))

    def _fill(self, name):
        disk = self.farm.disks[name]
        if disk.short():
            return False
        seconds = self.chosen.uniform(2, 6)
        disk.fill(seconds)
        self._undo.append((time.monotonic() + seconds, disk.free))
        return True

    def fill_coordinators_disk(self):
        return self._fill('coordinator')

    def fill_workers_disk(self):
        return self._fill('worker-2')

    def kill_client(self):
        clients = dict(self.farm.waiting_clients)
        if not clients:
            return False
        clients[self.chosen.choice(sorted(clients))].kill()
        return True
