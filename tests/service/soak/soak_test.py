#!/usr/bin/env python3
"""The soak must notice what is spoilt: a picture, a count of samples, and what is left behind or grows. Its argument is the folder of the programs."""

import re
import subprocess
import sys
from pathlib import Path

NOTICED = {
    'picture': r'is not .*reference',
    'samples': r'expected -1',
    'child': r'has lost its parent and goes on: sleep 1000',
    'file': r'files in blobs after every job was deleted',
    'descriptors': r'coordinator has \d+ descriptors at the end',
    'memory': r'the memory of coordinator grew',
    'program': r'ended by itself with code -9',
}


def main():
    failures = 0
    for what, words in NOTICED.items():
        done = subprocess.run([sys.executable, str(Path(__file__).parent / 'soak.py'), '--bin', sys.argv[1], '--minutes', '1.5', '--seed', '3', '--spoil', what],
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=900)
        noticed = [line for line in done.stdout.splitlines() if line.startswith('problem: ') and re.search(words, line)]
        print(f'{what}: exit code {done.returncode}, {noticed[0] if noticed else "not noticed"}', flush=True)
        if done.returncode != 1 or not noticed:
            print(done.stdout)
            failures += 1
    sys.exit(1 if failures else 0)


if __name__ == '__main__':
    main()
