"""Substitute for the commands of Slurm, with which `ensemble.sh --engine slurm` runs anywhere."""

import os
from pathlib import Path

from whole_runs import executable

#: The tasks of an array run one after the other, but all are reported as running at the same time.
#: As in Slurm, the job number of the last task is that of the array, and `squeue` prints a line for
#: each requested task of the array.
COMMANDS = {
    "sbatch": """echo 1 >>"$LAB/jobs"
for word; do
  case $word in
  --array=*) range=${word#*=1-} && range=${range%%%*} ;;
  --output=*) output=${word#*=} ;;
  esac
done
cat >"$LAB/task"
echo "$range" >"$LAB/array"
for ((k = 1; k <= range; k++)); do
  SLURM_ARRAY_JOB_ID=7 SLURM_ARRAY_TASK_ID=$k SLURM_JOB_ID=$((k < range ? 7 + k : 7)) \
    bash "$LAB/task" >>"$output" 2>&1
  echo "$?" >>"$LAB/codes"
done
echo 7
""",
    "scontrol": """case $1 in
requeue) echo "$2" >>"$LAB/requeued" ;;
*) echo "MaxArraySize            = ${ARRAYS:-3}" ;;
esac
""",
    "squeue": """[[ -n ${SLURM_ARRAY_TASK_ID:-} ]] || exit 0 # all tasks have ended
for word; do
  case $word in
  --jobs=7) for ((k = 1; k <= $(<"$LAB/array"); k++)); do echo RUNNING; done ;;
  --jobs=*) echo RUNNING ;;
  esac
done
""",
}


def slurm_surroundings(folder: Path) -> dict[str, str]:
    """Write the commands to a folder; return the environment variables that select them."""
    (folder / "bin").mkdir()
    for name, text in COMMANDS.items():
        executable(folder / "bin" / name, text, "bash")
    return {"PATH": f"{folder}/bin:{os.environ['PATH']}", "LAB": str(folder)}
