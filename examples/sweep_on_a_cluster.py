"""A sweep on a Dask cluster, here of two processes on this machine: `pip install 'pivoting[sweep]'`."""

import tempfile
from pathlib import Path

from pivoting import read_sweep, sweep

SETS = {"mass": "0.8:1.2", "com": "-0.05:0.05"}  # the controller is told of them, and each world draws its own
SHORT = {"mu": 0.25, "f_min": 20.0, "theta_end": 30.0, "seconds": 0.5, "disturbance": 10.0}
LIMITS = {"angle_max_deg": 0.5, "angle_rms_deg": 0.2, "settle_s": 0.2}


def main() -> None:
    """Any executor of `concurrent.futures` would do in place of Dask's."""
    from distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
        tempfile.TemporaryDirectory() as folder,
    ):
        out = Path(folder) / "worlds.parquet"  # a sweep that is killed goes on from what is there: resume=True
        pool = client.get_executor(pure=False)
        swept = sweep("pivot-2d", 24, SETS, out=out, chunk=6, executor=pool, limits=LIMITS, **SHORT)
        again = read_sweep(out)
    print(f"{len(swept.failed)} of {swept.worlds} worlds fail; the file has {again.worlds}")
    run = swept.replay(5)
    print("run again alone, world 5 is the same:", run.measures.slip_max_m[0] == swept.rows["slip_max_m"][5])


if __name__ == "__main__":  # the workers import this file, too
    main()
