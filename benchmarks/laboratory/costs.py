"""What a step of each method costs, as a fit over the charts: the table by which the engine chooses.

    python -m benchmarks.laboratory.costs

Reads what ``make charts`` measured and writes src/steelyard/costs.json. Kernels work through the index tape, so the
cost of a step is fitted by a constant and a part for each kind of work (``Candidate.work``), none negative, with
relative errors. Scenes whose contacts are written in Python are left out: the calls cost more than the steps.
"""

from __future__ import annotations

import json
import math

import numpy as np
from scipy.optimize import nnls

import steelyard as sy
from benchmarks import record
from benchmarks.laboratory import methods, problems

CHARTS = record.RESULTS / "charts"
TABLE = record.ROOT / "src" / "steelyard" / "costs.json"


def measured() -> dict[str, list[tuple[float, ...]]]:
    """By method: what ``Candidate.work`` counts, then the cost of running a step once [us]; by problem and work."""
    rows: dict[str, list[tuple[float, ...]]] = {}
    for name in problems.NAMES:
        found = json.loads((CHARTS / f"{name}.json").read_text())["variants"]
        for problem in problems.load(name):
            scene = problem.scene()
            if scene.of(sy.ContactGenerator):
                continue
            contacts = sy.contacts_at_a_time(scene, problem.duration)
            for candidate in methods.able(problem, scene):
                kinked = candidate.integrator.divisions > 0 and candidate.solver is None
                events = sy.kinks_per_second(scene, problem.duration) if kinked else 0.0
                costs: dict[tuple[float, ...], list[float]] = {}
                model = sy.World(scene, method=candidate.at(problem.stretch / 8.0)).model
                for point in found[problem.name]["points"]:
                    alike = point["method"] == candidate.name and point["worlds"] > 1
                    if alike and point["per_second"]:
                        dt = point["dt"]
                        work = candidate.work(scene, model, dt, contacts)
                        cost = point["per_second"] * dt / candidate.runs(events * dt)
                        costs.setdefault(work, []).append(cost)
                for work, found_costs in costs.items():
                    row = (*work, float(np.median(found_costs)))
                    rows.setdefault(candidate.name, []).append(row)
    return rows


def fit(rows: list[tuple[float, ...]]) -> tuple[list[float], float]:
    """Cost of each kind of work [us]; root mean square of the relative error."""
    data = np.array(rows)
    features = data[:, :-1] / data[:, -1:]
    coefficients, distance = nnls(features, np.ones(len(data)))
    return coefficients.tolist(), float(distance) / math.sqrt(len(data))


def main() -> None:
    """Fit and write."""
    rows = measured()
    fits = {name: fit(rows[name]) for name in sorted(rows)}
    payload = {
        "source": "python -m benchmarks.laboratory.costs, from benchmarks/results/charts",
        "units": "us per step and world: constant, per particle, per word on the tape, per spring, per drag, "
        "per part of a body's turn, per KiB of scratch that the nearest cache does not hold, per contact of bodies",
        "coefficients": {name: coefficients for name, (coefficients, _) in fits.items()},
        "relative_error": {name: error for name, (_, error) in fits.items()},
    }
    TABLE.write_text(json.dumps(payload, indent=1) + "\n")
    for name, (coefficients, error) in fits.items():
        parts = "  ".join(f"{value:.3g}" for value in coefficients)
        print(f"{name:<28} {parts}   within {error:.0%} over {len(rows[name])} rows")


if __name__ == "__main__":
    main()
