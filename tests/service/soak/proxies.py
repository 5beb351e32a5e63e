"""TCP proxies of this machine that can be cut: how a test takes the network away without being root."""

import selectors
import socket
import struct
import threading
import time

MAX_HELD = 1 << 18


class Line:
    """One connection, both ways."""

    def __init__(self, proxy, client, server):
        self.proxy, self.ends, self.held, self.ended = proxy, (client, server), (bytearray(), bytearray()), False


class Proxies:
    """Carries connections for several listeners, in one thread."""

    def __init__(self):
        self._lock = threading.Lock()
        self._listeners, self._lines, self._targets, self._silent_until = [], [], [], []
        self._resets, self._stop = set(), False
        self._thread = threading.Thread(target=self._run, name='proxies', daemon=True)
        self._thread.start()

    def add(self, port):
        """A listener whose connections lead to `port`. Returns its number and its own port."""
        listener = socket.create_server(('127.0.0.1', 0), backlog=64)
        listener.setblocking(False)
        with self._lock:
            self._listeners.append(listener)
            self._targets.append(port)
            self._silent_until.append(0.0)
            return len(self._listeners) - 1, listener.getsockname()[1]

    def reset(self, number):
        """Ends its connections as a router does that forgets them."""
        with self._lock:
            self._resets.add(number)

    def silence(self, number, seconds):
        """Carries nothing for a while, and keeps what it was given."""
        with self._lock:
            self._silent_until[number] = time.monotonic() + seconds

    def stop(self):
        self._stop = True
        self._thread.join()
        for line in list(self._lines):
            self._close(line, hard=False)
        for listener in self._listeners:
            listener.close()

    def _run(self):
        while not self._stop:
            with self._lock:
                silent = {i for i, until in enumerate(self._silent_until) if until > time.monotonic()}
                resets, self._resets = self._resets, set()
                listeners = list(enumerate(self._listeners))
            for line in [line for line in self._lines if line.proxy in resets]:
                self._close(line, hard=True)
            with selectors.DefaultSelector() as waits:
                for number, listener in listeners:
                    if number not in silent:
                        waits.register(listener, selectors.EVENT_READ, number)
                for line in self._lines:
                    if line.proxy not in silent:
                        self._register(waits, line)
                for key, events in waits.select(0.05):
                    if isinstance(key.data, int):
                        self._accept(key.data, key.fileobj)
                    else:
                        self._carry(*key.data, events)

    def _register(self, waits, line):
        for side in (0, 1):
            events = selectors.EVENT_READ if not line.ended and len(line.held[side]) < MAX_HELD else 0
            events |= selectors.EVENT_WRITE if line.held[1 - side] else 0
            if events:
                waits.register(line.ends[side], events, (line, side))
        if line.ended and not any(line.held):
            self._close(line, hard=False)

    def _accept(self, number, listener):
        try:
            client, _ = listener.accept()
        except OSError:
            return
        try:
            server = socket.create_connection(('127.0.0.1', self._targets[number]), timeout=1)
        except OSError:
            client.close()
            return
        for end in (client, server):
            end.setblocking(False)
            end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._lines.append(Line(number, client, server))

    def _carry(self, line, side, events):
        """`held[side]` is what that side has sent, for the other."""
        if line not in self._lines:
            return
        try:
            if events & selectors.EVENT_READ:
                data = line.ends[side].recv(1 << 16)
                line.held[side].extend(data)
                line.ended = line.ended or not data
            if events & selectors.EVENT_WRITE:
                del line.held[1 - side][:line.ends[side].send(line.held[1 - side])]
        except BlockingIOError:
            pass
        except OSError:
            self._close(line, hard=False)

    def _close(self, line, hard):
        if line in self._lines:
            self._lines.remove(line)
        for end in line.ends:
            if hard:
                end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack('ii', 1, 0))
            end.close()
