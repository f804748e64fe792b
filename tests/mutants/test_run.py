#!/usr/bin/env python3
"""Tests tests/mutants/run on a project made for it: each verdict, from a mutant that earns it.

usage: test_run.py CMAKE COMPILER
"""

import pathlib
import shutil
import subprocess
import sys
import tempfile
import textwrap
import unittest

RUN = pathlib.Path(__file__).with_name("run")
CMAKE, COMPILER = "cmake", "c++"

FILES = {
    "CMakeLists.txt": """
        cmake_minimum_required(VERSION 3.25)
        project(toy CXX)
        set(CMAKE_CXX_STANDARD 20)
        set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
        set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)
        find_package(GTest REQUIRED)
        add_library(toy STATIC lib/half.cpp lib/unused.cpp)
        target_include_directories(toy PUBLIC ${CMAKE_SOURCE_DIR})
        add_library(batch STATIC lib/third.cpp lib/fourth.cpp)
        target_include_directories(batch PUBLIC ${CMAKE_SOURCE_DIR})
        set_target_properties(batch PROPERTIES UNITY_BUILD ON)
        add_executable(toy_test tests/test.cpp)
        target_link_libraries(toy_test PRIVATE toy batch GTest::gtest GTest::gtest_main)
        """,
    "lib/half.h": """
        #pragma once
        double half(double x);
        inline double twice(double x) { return 2 * x; }
        """,
    "lib/half.cpp": """
        #include "lib/half.h"
        double half(double x) { return twice(x) / 4; }
        double untested(double x) { return x + 1; }
        """,
    "lib/unused.cpp": "int unused() { return 3; }\n",
    "lib/third.cpp": """
        #include "lib/half.h"
        double third(double x) { return twice(x) / 6; }
        """,
    "lib/fourth.cpp": "double fourth(double x) { return x / 4; }\n",
    "tests/test.cpp": """
        #include <gtest/gtest.h>
        #include <cstdlib>
        #include <string>
        double third(double x);
        double fourth(double x);
        #include "lib/half.h"
        TEST(Toy, Half) { EXPECT_EQ(half(3), 1.5); }
        TEST(Toy, Twice) { EXPECT_EQ(twice(3), 6); }
        TEST(Toy, Third) { EXPECT_EQ(third(3), 1); }
        TEST(Toy, Fourth) { EXPECT_EQ(fourth(4), 1); }
        TEST(Toy, Skips) { GTEST_SKIP(); }
        TEST(Toy, Proved) {
          const char* proofs = std::getenv("CANDELA_PROOFS");
          if (proofs == nullptr || std::string(proofs) != "off") GTEST_SKIP() << "its films are proved";
          EXPECT_EQ(half(3), 1.5);
        }
        TEST(Toy, Fails) { EXPECT_EQ(half(3), 7); }
        """,
}


def mutant(name, test, find, replace, file="lib/half.cpp", timeout=60):
    return (f"[[mutant]]\nname = '{name}'\nwhat = ''\nfile = '{file}'\ntest = 'toy_test:{test}'\ntimeout = {timeout}\n"
            f"find = '''{find}'''\nreplace = '''{replace}'''\n")


class TheCommand(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls.scratch.name)
        cls.source, cls.build = cls.root / "source", cls.root / "build"
        for name, text in FILES.items():
            (cls.source / name).parent.mkdir(parents=True, exist_ok=True)
            (cls.source / name).write_text(textwrap.dedent(text))
        cls.launched = cls.root / "launched"
        launcher = cls.root / "launcher"
        launcher.write_text(f'#!/bin/sh\necho "$@" >>"{cls.launched}"\nexec "$@"\n')
        launcher.chmod(0o755)
        for command in ([CMAKE, "-G", "Ninja", f"-DCMAKE_CXX_COMPILER={COMPILER}", f"-DCMAKE_CXX_COMPILER_LAUNCHER={launcher}",
                         "-S", cls.source, "-B", cls.build],
                        ["ninja", "-C", cls.build]):
            done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode != 0:
                raise RuntimeError(done.stdout + done.stderr)

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    def judge(self, text, *options):
        """Exit status, and verdicts by name."""
        listed = self.root / "mutants.toml"
        listed.write_text(text)
        done = subprocess.run([RUN, self.build, "--mutants", listed, *options], capture_output=True, text=True)
        rows = [line.split(" | ") for line in done.stdout.splitlines() if line.startswith("| ")]
        return done.returncode, {row[0].lstrip("| "): row[4] for row in rows[1:]}, done.stdout + done.stderr

    def snapshot(self):
        return {file: (file.stat().st_mtime_ns, file.read_bytes())
                for folder in (self.source, self.build) for file in sorted(folder.rglob("*")) if file.is_file()}

    def test_verdicts(self):
        body = "return twice(x) / 4;"
        before = self.snapshot()
        status, verdicts, said = self.judge(
            mutant("caught-source", "Toy.Half", body, "return twice(x) / 4.04;") +
            mutant("caught-proved", "Toy.Proved", body, "return twice(x) / 4.04;") +
            mutant("caught-header", "Toy.Half", "return 2 * x;", "return 2.02 * x;", "lib/half.h") +
            mutant("nothing", "Toy.Half", body, body) +
            mutant("not-looked-at", "Toy.Half", "return x + 1;", "return x + 2;") +
            mutant("crash", "Toy.Half", body, "return *static_cast<volatile double*>(nullptr);") +
            mutant("exit", "Toy.Half", body, "__builtin_exit(1);") +
            mutant("throw", "Toy.Half", body, "throw 1;") +
            mutant("hang", "Toy.Half", body, "for (volatile int i = 0;;) i = i + 1;", timeout=1) +
            mutant("nonsense", "Toy.Half", body, "return nonsense;") +
            mutant("undefined", "Toy.Half", body, "double f(); return f();") +
            mutant("gone", "Toy.Half", "return twice(x) / 5;", "") +
            mutant("twice", "Toy.Half", "return", "return 1 +") +
            mutant("no-file", "Toy.Half", body, "", "lib/gone.cpp") +
            mutant("not-linked", "Toy.Half", "return 3;", "return 4;", "lib/unused.cpp") +
            mutant("no-test", "Toy.None", body, "return 1;") +
            mutant("skipped-test", "Toy.Skips", body, "return 1;") +
            mutant("red-test", "Toy.Fails", body, "return 1;"))
        self.assertEqual(verdicts, {
            "caught-source": "caught", "caught-proved": "caught", "caught-header": "caught", "nothing": "SURVIVED", "not-looked-at": "SURVIVED",
            "crash": "CRASHED", "exit": "CRASHED", "throw": "THREW", "hang": "TIMEOUT", "nonsense": "DOES NOT COMPILE",
            "undefined": "DOES NOT LINK", "gone": "NO LONGER APPLIES", "twice": "NO LONGER APPLIES",
            "no-file": "NO LONGER APPLIES", "not-linked": "NOT LINKED", "no-test": "NOT RUN",
            "skipped-test": "NOT RUN", "red-test": "FAILS UNBROKEN"}, said)
        self.assertEqual(status, 1)
        self.assertEqual(self.snapshot(), before, "sources or build were touched")

    def test_all_caught_is_success(self):
        one = mutant("a", "Toy.Half", "twice(x) / 4", "twice(x) / 5")
        other = mutant("b", "Toy.Half", "twice(x) / 4", "twice(x) / 4")
        self.assertEqual(self.judge(one)[:2], (0, {"a": "caught"}))
        self.assertEqual(self.judge(one + other, "a")[:2], (0, {"a": "caught"}))
        self.assertEqual(self.judge(one + other)[0], 1)
        self.assertEqual(self.judge(one, "c")[0], 2)
        self.assertEqual(self.judge(one + one)[0], 2)

    def test_a_source_of_a_batch_is_replaced_alone(self):
        broken = mutant("third", "Toy.Third", "twice(x) / 6", "twice(x) / 7", "lib/third.cpp")
        beside = mutant("fourth", "Toy.Fourth", "twice(x) / 6", "twice(x) / 7", "lib/third.cpp")
        status, verdicts, said = self.judge(broken + beside)
        self.assertEqual((status, verdicts), (1, {"third": "caught", "fourth": "SURVIVED"}), said)

    def test_the_cache_compiles_in_a_folder_that_is_kept(self):
        """Claim: with --work the build's launcher compiles a mutant, under the same names each time; without it does not."""
        one = mutant("a", "Toy.Half", "twice(x) / 4", "twice(x) / 5")
        runs = []
        for options in ([], ["--work", self.root / "kept"], ["--work", self.root / "kept"]):
            self.launched.write_text("")
            self.assertEqual(self.judge(one, *options)[:2], (0, {"a": "caught"}))
            runs.append(self.launched.read_text())
        self.assertEqual(runs[0], "")
        self.assertIn("half.cpp", runs[1])
        self.assertEqual(runs[1], runs[2])

    def test_the_short_form_looks_at_all_texts(self):
        short = mutant("a", "Toy.Half", "twice(x) / 4", "twice(x) / 5") + "short = true\n"
        gone = mutant("b", "Toy.Half", "twice(x) / 7", "")
        self.assertEqual(self.judge(short + mutant("c", "Toy.Half", "x + 1", "x"), "--short")[:2], (0, {"a": "caught"}))
        status, verdicts, said = self.judge(short + gone, "--short")
        self.assertEqual((status, verdicts), (1, {"a": "caught"}))
        self.assertIn("b: NO LONGER APPLIES", said)

    def test_a_build_older_than_its_sources_is_refused(self):
        source = self.source / "lib/half.cpp"
        text = source.read_text()
        try:
            source.write_text(text + "// younger\n")
            status, _, said = self.judge(mutant("a", "Toy.Half", "twice(x) / 4", "twice(x) / 5"))
            self.assertEqual(status, 2, said)
            self.assertIn("older than its sources", said)
        finally:
            source.write_text(text)
            subprocess.run(["ninja", "-C", self.build], check=True, capture_output=True)

    def test_what_is_absent_is_skipped(self):
        listed = self.root / "mutants.toml"
        listed.write_text(mutant("a", "Toy.Half", "twice(x) / 4", "twice(x) / 5").replace("toy_test", "other_test"))
        for build in (self.build, self.root / "nowhere"):
            done = subprocess.run([RUN, build, "--mutants", listed], capture_output=True, text=True)
            self.assertEqual(done.returncode, 77, done.stdout)
            self.assertIn("skipped: ", done.stderr)


if __name__ == "__main__":
    if len(sys.argv) > 2:
        CMAKE, COMPILER = sys.argv[1:3]
        del sys.argv[1:3]
    if shutil.which("ninja") is None:
        print("skipped: there is no ninja")
        sys.exit(77)
    unittest.main()
