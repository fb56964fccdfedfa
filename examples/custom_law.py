"""A law of your own in Python: a spring that slips, fitted to runs of the virtual rig at two currents.

python examples/custom_law.py    (on files: mrdamper fit DIR --law examples/custom_law.py:Slipping ...)
"""

import mrdamper
from mrdamper.models.laws import Coefficient
from mrdamper.virtual_rig.campaign import Campaign
from mrdamper.virtual_rig.measurement import measure
from mrdamper.virtual_rig.plant import find_preset

Values = dict[str, float]


class Slipping:
    """The state z is the stretch of the spring divided by the yield displacement."""

    name = "slipping"
    coefficients = (
        Coefficient("yield_force", "N", "force at which it slips", linear=True, lower=0.0, upper=1e4),
        Coefficient("viscosity", "N s/m", "of the dashpot beside it", linear=True, lower=0.0, upper=1e5),
        Coefficient("rho", "1/m", "inverse yield displacement", linear=False, lower=10.0, upper=1e5),
    )

    def rate(self, z: float, x: float, v: float, values: Values) -> float:
        return values["rho"] * (v - abs(v) * z)

    def force(self, z: float, x: float, v: float, values: Values) -> float:
        return values["yield_force"] * z + values["viscosity"] * v


if __name__ == "__main__":
    tests = Campaign(
        motions=("sine3mm2Hz",), currents_A=(0.0, 1.0), temperatures_degC=(20.0,), steps=None, duration_s=1.0
    )
    runs = [run for run, _ in measure(find_preset("nominal"), tests)]
    fitted = mrdamper.fit(runs, Slipping, temperature="none")
    print(f"error {fitted.cost_percent:.2f} % in {fitted.cpu_s:.0f} s")
