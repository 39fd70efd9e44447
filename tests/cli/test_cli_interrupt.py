"""Ctrl-C in a process of its own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time


def test_interrupt_while_reading_leaves_no_file(csv, tmp_path):
    command = [sys.executable, "-m", "northdown", "estimate", "-", "-o", str(tmp_path / "out.csv")]
    content = csv.read_bytes()
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        # more than a pipe holds: once it is taken, the program is at work
        process.stdin.write(content * (1 + 500_000 // len(content)))
        process.stdin.flush()
        # Python sees a signal that comes just before a blocking read only after it: let it wait for more first
        time.sleep(0.3)
        process.send_signal(signal.SIGINT)
        try:
            process.wait(timeout=60)
        finally:
            process.kill()
        out, err = process.stdout.read(), process.stderr.read()
    assert (process.returncode, out, err) == (130, b"", b"interrupted\n")
    assert os.listdir(tmp_path) == []
