"""An example script with correct and wrong calls of the package, for two type checkers.

Each wrong line has a ``type: ignore`` comment. The checkers report a comment on a correct line, so that they
accept the script only if every marked line is wrong.
"""

from __future__ import annotations

import polars as pl

import mrdamper


def correct(folder: str) -> float:
    """Use the public functions with correct types."""
    runs = mrdamper.read("logger.csv", {"displacement_mm": "Pos", "force_kN": "Load", "current_A": 1.0})
    fitted = mrdamper.fit(runs, "bouc-wen", hold_out=["*_1.00A"], terms=["friction"], temperature="none")
    checked: str = mrdamper.check([folder, pl.DataFrame({"force_N": [0.0]})], deep=True).summary()
    card: mrdamper.ModelCard = fitted.card(title=checked)
    card.save(f"{folder}/card.json")
    same = mrdamper.read_card(f"{folder}/card.json")
    error_N: float = mrdamper.evaluate(same, mrdamper.read_runs([folder])).errors[0].rmse_N
    force: float = card.simulate("sine:10mm:1Hz:1A:2s", temperature_degC=40.0).force.max()
    hot = card.heat("paper", ambient_degC=35, model="lumped")
    mrdamper.heatsink(card, "paper", mass_g=500.0).plot().savefig("sink.svg")
    mrdamper.derate(card, "paper", quantity="stroke", ambient_degC=(20.0, 40.0)).to_frame()
    card.track("hard", targets=["sine-900N-1Hz"], controllers=["paper"]).save(folder)
    card.export(c="controller", content="controller").summary()
    table: pl.DataFrame = mrdamper.cycles("record.csv", least_stroke_mm=2.0).to_frame()
    mrdamper.fluid(["viscosity.csv"], like="paper").plot()
    mrdamper.rig("nominal", campaign="short", seed=1).dataset.plot()
    mrdamper.sweep([folder], law="dahl", workers=1)
    mrdamper.compare(card, same).summary()
    return error_N + force + table.height + fitted.cost_percent + float(hot.rise.fluid_degC[0])


def wrong(card: mrdamper.ModelCard) -> None:
    """Use misspelled options and wrong types."""
    mrdamper.fit("runs", laws="dahl")  # type: ignore[call-arg]
    mrdamper.fit("runs", hold_out=3)  # type: ignore[arg-type]
    mrdamper.fit("runs", terms=["frictoin"])  # type: ignore[list-item]
    mrdamper.check(3.0)  # type: ignore[arg-type]
    mrdamper.heat(card, "paper", ambient_degF=90.0)  # type: ignore[call-arg]
    card.heat("paper", model="reducd")  # type: ignore[arg-type]
    card.heat()  # type: ignore[call-arg]
    card.simulate(temperature_degC=40.0)  # type: ignore[call-arg]
    card.export(fmu=True)  # type: ignore[arg-type]
    print(mrdamper.heat(card, "paper").rise_K)  # type: ignore[attr-defined]
