#!/usr/bin/env python3
"""run_mutants.py in a small tree of its own: what it calls caught, survived, stale and broken, and what --check finds."""

import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

SCRIPT = Path(__file__).resolve().parent / 'run_mutants.py'

CMAKE = '''cmake_minimum_required(VERSION 3.25)
project(small LANGUAGES CXX)
find_package(GTest REQUIRED)
function(woodcock_test name)
  cmake_parse_arguments(ARG "" "" "SOURCES" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE code GTest::gtest_main)
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/tests)
endfunction()
add_library(code STATIC code.cpp)
target_include_directories(code PUBLIC ${CMAKE_SOURCE_DIR})
add_subdirectory(tests/hard_cases)
'''
CODE = '''int half(int x) { return x / 2; }
int at(const int* p) {
  if (p == nullptr) return 0;
  return *p;
}
'''
TEST = '''#include <gtest/gtest.h>
int half(int);
int at(const int*);
TEST(HardCases, N01_half_of_two_is_one) { EXPECT_EQ(half(2), 1); }
TEST(HardCases, N02_nothing_is_nought) { EXPECT_EQ(at(nullptr), 0); }
'''
TABLE = '| N01 | a | b | c | yes |\n| N02 | a | b | c | yes |\n| N03 | a | b | c | open |\n'
CAUGHT = 'N01.1 halves\nin code.cpp\n- return x / 2;\n+ return x;\nfails N01_half_of_two_is_one\n'
CRASH = 'N02.1 asks first\nin code.cpp\n- if (p == nullptr) return 0;\n+\nfails N02_nothing_is_nought\n'
SURVIVED = 'N01.2 halves\nin code.cpp\n- x / 2\n+ x - x / 2\nfails N01_half_of_two_is_one\n'
STALE = 'N01.3 halves\nin code.cpp\n- return x / 3;\n+ return x;\nfails N01_half_of_two_is_one\n'
BROKEN = 'N01.4 halves\nin code.cpp\n- return x / 2;\n+ return y;\nfails N01_half_of_two_is_one\n'
TWO_LINES = 'N02.2 asks first\nin code.cpp\n- return 0; return *p;\n+ return 1; return *p;\nfails N02_nothing_is_nought\n'


class RunMutants(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.root = Path(self.folder.name)
        self.write('CMakeLists.txt', CMAKE)
        self.write('code.cpp', CODE)
        self.write('tests/hard_cases/CMakeLists.txt', 'woodcock_test(small_test SOURCES small_test.cpp)\n')
        self.write('tests/hard_cases/small_test.cpp', TEST)
        self.write('tests/hard_cases/README.md', TABLE)

    def tearDown(self):
        self.folder.cleanup()

    def write(self, name, text):
        (self.root / name).parent.mkdir(parents=True, exist_ok=True)
        (self.root / name).write_text(text, encoding='utf-8')

    def run_script(self, mutants, *arguments):
        self.write('tests/hard_cases/mutants.txt', '\n'.join(mutants))
        command = [sys.executable, str(SCRIPT), '--root', str(self.root), '--list', str(self.root / 'tests/hard_cases/mutants.txt'), *arguments]
        done = subprocess.run(command, capture_output=True, text=True)
        return done.returncode, done.stdout + done.stderr

    def check(self, *mutants):
        return self.run_script(mutants, '--check')

    def test_each_kind_of_mutant_is_told(self):
        code, said = self.run_script([CAUGHT, CRASH, SURVIVED, STALE, BROKEN, TWO_LINES])
        self.assertEqual(code, 1, said)
        self.assertEqual(said.split('\n')[-2], '3 caught, 1 survived, 1 stale, 1 broken')
        for verdict, name in [('caught', 'N01.1'), ('caught', 'N02.1'), ('survived', 'N01.2'), ('stale', 'N01.3'), ('broken', 'N01.4'), ('caught', 'N02.2')]:
            self.assertRegex(said, rf'(?m)^{verdict} +{name} ')
        self.assertIn('ended by signal 11', said)
        self.assertEqual((self.root / 'code.cpp').read_text(), CODE)
        self.assertFalse((self.root / 'build/mutants/tree/build').exists())
        # The copy is as the tree again, and what is asked for is what runs.
        self.assertEqual((self.root / 'build/mutants/tree/code.cpp').read_text(), CODE)
        code, said = self.run_script([CAUGHT, CRASH, SURVIVED], '--rows', 'N02,N01.1')
        self.assertEqual((code, said.split('\n')[-2]), (0, '2 caught, 0 survived, 0 stale, 0 broken'), said)

    def test_a_test_that_fails_with_its_defence_proves_nothing(self):
        self.write('code.cpp', CODE.replace('x / 2', 'x'))
        code, said = self.run_script([CRASH, CAUGHT.replace('x / 2', 'x').replace('+ return x;', '+ return 2 * x;')])
        self.assertEqual(code, 1)
        self.assertIn('N01_half_of_two_is_one fails with its defence in place', said)

    def test_what_agrees_passes_the_check(self):
        self.assertEqual(self.check(CAUGHT, CRASH), (0, '3 rows, 2 mutants, 0 faults\n'))

    def test_the_check_finds_what_does_not_agree(self):
        for mutants, fault in [([CAUGHT, CRASH, STALE], 'N01.3 is stale'), ([CAUGHT], 'N02 has no mutant'),
                               ([CAUGHT, CRASH.replace('fails N02_nothing', 'fails N02_another')], 'N02_another_is_nought, which no program')]:
            code, said = self.check(*mutants)
            self.assertEqual(code, 1, said)
            self.assertIn(fault, said)
        self.write('code.cpp', CODE + CODE.replace('half', 'third'))
        self.assertIn('holds the old text 2 times', self.check(CAUGHT, CRASH)[1])

    def test_the_check_finds_rows_without_tests_and_tests_without_rows(self):
        self.write('tests/hard_cases/README.md', TABLE.replace('| open |', '| yes |'))
        self.assertIn('N03 has no test', self.check(CAUGHT, CRASH)[1])
        self.write('tests/hard_cases/README.md', TABLE.replace('| N02 | a | b | c | yes |', '| N02 | a | b | c | open |'))
        self.assertIn('N02 is open in README.md and has tests', self.check(CAUGHT, CRASH)[1])
        self.write('tests/hard_cases/README.md', TABLE.replace('| N02 | a | b | c | yes |\n', ''))
        self.assertIn('tests are named after N02, which README.md does not list', self.check(CAUGHT, CRASH)[1])

    def test_the_farm_has_a_list_and_rows_of_its_own(self):
        self.write('tests/faults/README.md', '| F01 | a | b | c | `F01_…` in small_test |\n')
        self.write('tests/hard_cases/small_test.cpp', TEST.replace('N01_', 'F01_'))
        farm = ['--check', '--list', str(self.root / 'tests/faults/mutants.txt')]
        for row, outcome in [('F01', (0, '1 rows, 1 mutants, 0 faults\n')), ('F02', (1, None))]:
            self.write('tests/faults/mutants.txt', CAUGHT.replace('N01', row))
            code, said = self.run_script([CAUGHT], *farm)
            self.assertEqual((code, said if outcome[1] else None), outcome, said)
        self.assertIn('F02.1 is of a row that README.md does not list', said)
        self.assertIn('F02_half_of_two_is_one, which no program', said)

    def test_a_list_that_cannot_be_read_is_an_error_with_its_line(self):
        for spoiled, place in [(CAUGHT.replace('in code.cpp\n', ''), 'mutants.txt:2:1'), (CAUGHT.replace('fails N01', 'fails N02'), 'mutants.txt:5:1'),
                               (CAUGHT + CAUGHT, 'mutants.txt:6:1'), (CAUGHT.replace('fails N01_half_of_two_is_one\n', ''), 'mutant N01.1 lacks')]:
            code, said = self.check(spoiled)
            self.assertEqual(code, 1)
            self.assertIn(place, said)


if __name__ == '__main__':
    unittest.main()
