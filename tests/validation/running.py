"""Execute the runs of the cases in parallel, and measure each case once its runs are finished."""

import hashlib
import re
import subprocess
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from ricochet import Run, RunError, read_run

from .case import Case, Member, Verdict, failed, judge

MOST_SECONDS = 1200


class Workshop:
    """Executes the run of each member once, several runs at a time, in one folder."""

    def __init__(self, program: Path, folder: Path, jobs: int, seed_shift: int = 0):
        """Store the settings; `seed_shift` is added to all seeds."""
        self.program, self.folder, self.seed_shift = program, folder, seed_shift
        self.pool = ThreadPoolExecutor(jobs)
        self.futures: dict[Member, Future] = {}
        folder.mkdir(parents=True, exist_ok=True)

    def order(self, member: Member) -> Future:
        """Return the future result of a member, after starting any members on which it depends."""
        for earlier in member.after:
            self.order(earlier)
        if member not in self.futures:
            self.futures[member] = self.pool.submit(self.make, member)
        return self.futures[member]

    def make(self, member: Member) -> Run:
        """Execute the run of a member; raise RunError if its exit code is not an expected one."""
        text = member.text
        if callable(text):
            text = text(*(self.futures[earlier].result() for earlier in member.after))
        name = hashlib.sha256(text.encode()).hexdigest()[:12]
        path = self.folder / f"{name}.nml"
        path.write_text(text)
        output = path.with_suffix(".h5")
        command = [self.program, path, "-o", output, "--force", "--quiet"]
        if self.seed_shift:
            seed = re.search(r"\bseed = (\d+)", text)  # 1 is the default of the program
            command += ["--set", f"run.seed={int(seed[1] if seed else 1) + self.seed_shift}"]
        ended = subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=MOST_SECONDS
        )
        if ended.returncode not in member.exit_codes:
            reason = ended.stderr.strip().splitlines() or ["no reason given"]
            raise RunError(f"{path.name} ended with {ended.returncode}: {reason[-1]}")
        part = output.with_name(f"{output.name}.part")
        return read_run(output if ended.returncode == 0 else part)


def validate(
    cases: list[Case], program: Path, folder: Path, jobs: int, seed_shift: int = 0
) -> Iterator[Verdict]:
    """Yield the verdicts in the order of the cases, as soon as they are known."""
    workshop = Workshop(program, folder, jobs, seed_shift)
    try:
        ordered = [[workshop.order(member) for member in case.members] for case in cases]
        for case, futures in zip(cases, ordered, strict=True):
            try:
                runs = [future.result() for future in futures]
            except (RunError, subprocess.TimeoutExpired) as problem:
                yield failed(case, str(problem))
            else:
                yield judge(case, runs)
    finally:
        workshop.pool.shutdown(cancel_futures=True)
