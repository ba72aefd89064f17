"""Plugin of pytest that prints the elapsed time whenever no test has ended for several seconds."""

import threading
import time

#: Longest time without output [s].
SILENCE = 8.0


class SignsOfLife:
    """Writes the elapsed time into the line of dots, from a thread of the main process."""

    def __init__(self, terminal):
        """Store the reporter that writes to the terminal."""
        self.write = terminal.write
        self.ended = threading.Event()
        self.began = self.last = time.monotonic()

    def pytest_sessionstart(self):
        threading.Thread(target=self.watch, daemon=True).start()

    def pytest_runtest_logreport(self):
        self.last = time.monotonic()

    def pytest_sessionfinish(self):
        self.ended.set()

    def watch(self):
        while not self.ended.wait(1):
            now = time.monotonic()
            if now - self.last > SILENCE:
                self.last = now
                self.write(f"({now - self.began:.0f} s)", flush=True)
