#!/usr/bin/env python3
"""Takes the defences of the hard cases, or of the farm, out, one after the other, and sees that their tests fail. README.md tells of it."""

import argparse
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
OPEN, TESTED = 'open', 'yes'
NUMERIC, FARM = 'N', 'F'  # rows of the two lists
TEST = re.compile(r'\bTEST(?:_F|_P)?\s*\(\s*\w+\s*,\s*([NF]\d\d_\w+)\s*\)')


class ListError(Exception):
    """The list or the table cannot be read; the message names file and line."""


class Edit:
    def __init__(self, file, line):
        self.file, self.line, self.old, self.new = file, line, None, None

    def pattern(self):
        return re.compile(r'\s+'.join(re.escape(word) for word in self.old.split()))


class Mutant:
    def __init__(self, name, defence):
        self.name, self.row, self.defence, self.edits, self.tests = name, name.split('.')[0], defence, [], []


def read_mutants(path):
    mutants, names = [], set()
    for number, line in enumerate(path.read_text(encoding='utf-8').split('\n'), 1):
        def fail(expected):
            raise ListError(f'{path.name}:{number}:1: found "{line}", expected {expected}')
        if not line.strip() or line.startswith('#'):
            continue
        head = re.fullmatch(r'([NF]\d\d\.\d+) (.+)', line)
        if head:
            if head[1] in names:
                fail('a name that no other mutant has')
            names.add(head[1])
            mutants.append(Mutant(head[1], head[2]))
            continue
        if not mutants:
            fail('a mutant first, "N01.1 what defends the row"')
        mutant, (word, _, rest) = mutants[-1], line.partition(' ')
        if word == 'in':
            mutant.edits.append(Edit(rest.strip(), number))
        elif word == '-' and mutant.edits and mutant.edits[-1].old is None and rest.strip():
            mutant.edits[-1].old = rest
        elif word == '-' and mutant.edits and mutant.edits[-1].new is not None and rest.strip():
            mutant.edits.append(Edit(mutant.edits[-1].file, number))
            mutant.edits[-1].old = rest
        elif word == '+' and mutant.edits and mutant.edits[-1].old is not None and mutant.edits[-1].new is None:
            mutant.edits[-1].new = rest
        elif word == 'fails' and rest.startswith(mutant.row + '_'):
            mutant.tests.append(rest.strip())
        else:
            fail('"in FILE", then "- old" and "+ new", then "fails NXX_test" of the same row')
    for mutant in mutants:
        if not mutant.edits or not mutant.tests or any(edit.new is None for edit in mutant.edits):
            raise ListError(f'{path.name}: mutant {mutant.name} lacks a place, an old or new text, or a test')
    return mutants


def read_rows(path):
    """Row → whether it is open, from the table of the README.md beside the list. The last cell of a farm's row names its tests."""
    rows = {}
    for number, line in enumerate(path.read_text(encoding='utf-8').split('\n'), 1):
        if not re.match(r'\| [NF]\d\d ', line):
            continue
        cells = [cell.strip() for cell in re.split(r'(?<!\\)\|', line)[1:-1]]
        if cells[0][0] == FARM:
            rows[cells[0]] = cells[-1] == '–'
            continue
        if len(cells) != 5 or not all(cells) or cells[4] not in (OPEN, TESTED) or cells[0] in rows:
            raise ListError(f'{path.name}:{number}:1: expected a row of its own with five cells, the last "{TESTED}" or "{OPEN}"')
        rows[cells[0]] = cells[4] == OPEN
    return rows


def find_tests(root):
    """Test → the programs it is in, by tests/**/CMakeLists.txt."""
    tests = {}
    for cmake in sorted((root / 'tests').rglob('CMakeLists.txt')):
        for program, sources in re.findall(r'woodcock_test\(\s*(\w+)\s+SOURCES\s+([^)]*)', cmake.read_text(encoding='utf-8')):
            for source in re.split(r'\s+(?:LINKS|LABELS|TIMEOUT)\b', sources)[0].split():
                file = cmake.parent / source
                if file.suffix == '.cpp' and file.exists():
                    for test in TEST.findall(file.read_text(encoding='utf-8')):
                        tests.setdefault(test, []).append(program)
    return tests


def mutated(root, mutant):
    """File → its text with the defence out; or None and the reason why the mutant is stale."""
    texts = {}
    for edit in mutant.edits:
        file = root / edit.file
        if not file.is_file():
            return None, f'there is no {edit.file}'
        text = texts.get(edit.file) or file.read_text(encoding='utf-8')
        places = list(edit.pattern().finditer(text))
        if len(places) != 1:
            return None, f'mutants.txt:{edit.line}: {edit.file} holds the old text {len(places)} times, expected once: {edit.old}'
        texts[edit.file] = text[:places[0].start()] + edit.new + text[places[0].end():]
    return texts, ''


def check(root, rows, mutants):
    """What does not agree between the table, the tests and the mutants."""
    faults, tests = [], find_tests(root)
    numeric = {row: is_open for row, is_open in rows.items() if row[0] == NUMERIC}
    tested = {test[:3] for test in tests if test[0] == NUMERIC} if numeric else set()
    for row, is_open in sorted(numeric.items()):
        if is_open and row in tested:
            faults.append(f'{row} is open in README.md and has tests: say "{TESTED}" there and give it a mutant in mutants.txt')
        elif not is_open and row not in tested:
            faults.append(f'{row} has no test: expected one named {row}_what_it_promises below tests/')
        if not is_open and all(mutant.row != row for mutant in mutants):
            faults.append(f'{row} has no mutant in mutants.txt')
    for row in sorted(tested - numeric.keys()):
        faults.append(f'tests are named after {row}, which README.md does not list')
    if rows and sorted(rows) != [f'{min(rows)[0]}{i:02}' for i in range(1, len(rows) + 1)]:
        faults.append('the rows of README.md are not N01, N02, …, or F01, F02, …, without a gap')
    for mutant in mutants:
        if mutant.row not in rows:
            faults.append(f'{mutant.name} is of a row that README.md does not list')
        for test in mutant.tests:
            if test not in tests:
                faults.append(f'{mutant.name} names {test}, which no program of tests/ has')
        texts, reason = mutated(root, mutant)
        if texts is None:
            faults.append(f'{mutant.name} is stale: {reason}')
    return faults


class Copy:
    """A copy of the tree that is built with mutants in it. The checkout is only read."""

    def __init__(self, root, work, options, jobs):
        self.root, self.tree, self.build, self.options, self.jobs = root, work / 'tree', work / 'build', options, jobs

    def sync(self):
        """Writes what differs and removes what is gone; the rest keeps its times, so that it is not built again."""
        wanted = set()
        for folder, folders, files in os.walk(self.root):
            here = Path(folder).relative_to(self.root)
            folders[:] = [f for f in folders if not (f.startswith('.') or here == Path('.') and f == 'build')]
            for name in files:
                wanted.add(here / name)
                source, target = self.root / here / name, self.tree / here / name
                if not target.exists() or target.read_bytes() != source.read_bytes():
                    target.parent.mkdir(parents=True, exist_ok=True)
                    shutil.copyfile(source, target)
        for target in list(self.tree.rglob('*')):
            if target.is_file() and target.relative_to(self.tree) not in wanted:
                target.unlink()

    def run(self, command, seconds, cwd=None):
        return subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors='replace', timeout=seconds, cwd=cwd)

    def configure(self):
        command = ['cmake', '-S', str(self.tree), '-B', str(self.build), '-G', 'Ninja', '-DCMAKE_BUILD_TYPE=Release',
                   '-DCMAKE_GTEST_DISCOVER_TESTS_DISCOVERY_MODE=PRE_TEST', *self.options]
        done = self.run(command, 600)
        if done.returncode != 0:
            sys.exit(f'run_mutants: the copy cannot be configured:\n{done.stdout}')

    def make(self, programs):
        """None, or what the compiler said."""
        done = self.run(['cmake', '--build', str(self.build), '-j', str(self.jobs), '--target', *sorted(programs)], 7200)
        return None if done.returncode == 0 else done.stdout

    def test(self, program, name, seconds):
        """None when the test passes, or how it failed."""
        try:
            done = self.run([str(self.build / 'tests' / program), f'--gtest_filter=*.{name}:*.{name}/*'], seconds, self.build)
        except subprocess.TimeoutExpired:
            return f'no end within {seconds:.0f} s'
        if done.returncode == 0:
            # A filter that meets nothing passes as well.
            return None if re.search(r'\[  PASSED  \] [1-9]', done.stdout) else sys.exit(f'run_mutants: {program} has no test {name}')
        if done.returncode < 0:
            return f'ended by signal {-done.returncode}'
        said = re.search(r'Failure\n(.*?)(?:\n\n|\n\[|\Z)', done.stdout, re.S)
        return ' '.join(said[1].split())[:160] if said else f'exit code {done.returncode}'


def judge(copy, mutant, programs_of, longest):
    """(verdict, detail) of one mutant; `longest`: seconds by test. The copy's files are as they were afterwards."""
    texts, reason = mutated(copy.tree, mutant)
    if texts is None:
        return 'stale', reason
    before = {file: (copy.tree / file).read_text(encoding='utf-8') for file in texts}
    try:
        for file, text in texts.items():
            (copy.tree / file).write_text(text, encoding='utf-8')
        wrong = copy.make({program for test in mutant.tests for program in programs_of[test]})
        if wrong is not None:
            error = re.search(r'.*\berror\b.*', wrong)
            return 'broken', error[0].strip()[:200] if error else 'the build failed'
        first = ''
        for test in mutant.tests:
            failures = [copy.test(program, test, longest[test]) for program in programs_of[test]]
            if None in failures:
                return 'survived', f'{test} passes without the defence: {mutant.defence}'
            first = first or f'{test}: {failures[0]}'
        return 'caught', first
    finally:
        for file, text in before.items():
            (copy.tree / file).write_text(text, encoding='utf-8')


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--rows', help='rows or mutants, e.g. N01,N07.2; all without')
    parser.add_argument('--check', action='store_true', help='compare rows, tests and mutants; build nothing')
    parser.add_argument('--root', type=Path, default=HERE.parent.parent, help='the tree')
    parser.add_argument('--list', type=Path, default=HERE / 'mutants.txt', help='the mutants')
    parser.add_argument('--work', type=Path, help='where the copy lies (default: build/mutants of the tree)')
    parser.add_argument('--jobs', type=int, default=os.cpu_count())
    parser.add_argument('--timeout', type=int, default=1800, help='seconds for one test')
    parser.add_argument('--optimise', default='-O1', help='-O1 builds faster than what users run (-O3)')
    arguments = parser.parse_args()
    root = arguments.root.resolve()
    try:
        mutants, rows = read_mutants(arguments.list), read_rows(arguments.list.resolve().parent / 'README.md')
    except ListError as error:
        sys.exit(f'run_mutants: {error}')
    if arguments.check:
        faults = check(root, rows, mutants)
        print('\n'.join(faults + [f'{len(rows)} rows, {len(mutants)} mutants, {len(faults)} faults']))
        sys.exit(1 if faults or not rows or not mutants else 0)

    if arguments.rows:
        wanted = set(arguments.rows.split(','))
        unknown = wanted - {m.row for m in mutants} - {m.name for m in mutants}
        if unknown:
            sys.exit(f'run_mutants: no mutant of {", ".join(sorted(unknown))} in {arguments.list.name}')
        mutants = [m for m in mutants if m.row in wanted or m.name in wanted]
    programs_of = find_tests(root)
    missing = [f'{m.name} names {t}' for m in mutants for t in m.tests if t not in programs_of]
    if missing:
        sys.exit(f'run_mutants: tests that no program has: {"; ".join(missing)}')

    copy = Copy(root, (arguments.work or root / 'build/mutants').resolve(),
                ['-DCMAKE_CXX_FLAGS_RELEASE=' + arguments.optimise + ' -DNDEBUG'], arguments.jobs)
    copy.sync()
    copy.configure()
    tests = sorted({test for mutant in mutants for test in mutant.tests})
    wrong = copy.make({program for test in tests for program in programs_of[test]})
    if wrong is not None:
        sys.exit(f'run_mutants: the tree does not build:\n{wrong[-4000:]}')
    # A mutant may make a test run for ever: ten times what it takes with its defence is enough.
    longest = {}
    for test in tests:
        start = time.monotonic()
        for program in programs_of[test]:
            if (failure := copy.test(program, test, arguments.timeout)) is not None:
                sys.exit(f'run_mutants: {test} fails with its defence in place: {failure}')
        longest[test] = min(arguments.timeout, 60 + 10 * (time.monotonic() - start))
    print(f'{len(tests)} tests pass with their defences in place', flush=True)

    counts = dict.fromkeys(['caught', 'survived', 'stale', 'broken'], 0)
    # Mutants of one file follow each other: what is put back is built along with the next.
    for mutant in sorted(mutants, key=lambda m: (m.edits[0].file, m.name)):
        start = time.monotonic()
        verdict, detail = judge(copy, mutant, programs_of, longest)
        counts[verdict] += 1
        print(f'{verdict:<8} {mutant.name:<6} {mutant.edits[0].file} ({time.monotonic() - start:.0f} s) {detail}', flush=True)
    print(', '.join(f'{count} {verdict}' for verdict, count in counts.items()))
    sys.exit(0 if counts['caught'] == len(mutants) else 1)


if __name__ == '__main__':
    main()
