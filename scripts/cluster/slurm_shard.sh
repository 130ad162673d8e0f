#!/usr/bin/env bash
#SBATCH --job-name=finalgather --array=1-16 --cpus-per-task=1
#SBATCH --requeue --open-mode=append
#SBATCH --signal=TERM@60
# A shard, as a task of the array that slurm.sh submits. Above goes what a task takes: cores or --gpus=1, --mem, --time, --constraint.
# A minute before its time is over it is told to stop, and keeps what it has.
srun --cpus-per-task="$SLURM_CPUS_PER_TASK" finalgather "$@" --shard auto --resume && exit
status=$?
# Slurm by itself requeues what it preempts and what a node takes down with it, but not what was killed (by the system, out of memory),
# told to stop or found the disk full (75). Any other failure would come again.
if (( status == 75 || status > 128 )) && (( ${SLURM_RESTART_COUNT:-0} < 9 )); then
    echo "ended with $status: requeued"
    scontrol requeue "${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID"
fi
exit $status
