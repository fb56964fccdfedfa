"""The heating problem as a FreeFem++ script: the same mesh, but independent assembly and time steps.

The problem is fully nonlinear: heat-transfer coefficients are interpolated at the surface temperature, with
radiation and temperature-dependent sources. The time steps use Alexander's two-stage SDIRK method (L-stable,
order 2) with a fixed-point iteration in each stage, instead of the ROS2 method of the package.

``python -m tests.oracles.freefem 20`` compares the reduced model, which ``heat`` uses, with FreeFem++ on 20
random bodies and prints the errors (``10 20``: from the tenth body on). The random seeds of the bodies are
odd. They were not used to choose constants of the model.
"""

from __future__ import annotations

import math
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.thermal.films.correlations import STEFAN_BOLTZMANN
from mrdamper.thermal.materials import COPPER_PER_K
from mrdamper.thermal.model.finite_element import FieldModel, build_field
from mrdamper.thermal.model.heat_equation import simulate_field
from mrdamper.thermal.model.mesh import SectionMesh
from mrdamper.thermal.model.reduced import reduce_field
from mrdamper.thermal.model.stepping import Load
from tests.oracles.programs import run_program
from tests.thermal.bodies import draw_body, odd_bodies

__all__ = ["FreefemCourse", "run_freefem", "score_reduced", "write_freefem"]

_INSULATED = 1000  # Label of insulated sides of the outline


@dataclass(frozen=True, slots=True, eq=False)
class FreefemCourse:
    """Temperatures that FreeFem++ has computed."""

    nodes: FloatArray  # Positions (r, z) of the nodes [m], shape (n, 2)
    temperature: FloatArray  # Final temperatures of the nodes [K], shape (n,)
    time: FloatArray  # Times [s], shape (k,)
    fluid: FloatArray  # Mean temperature of the fluid [K], shape (k,)
    coil: FloatArray  # Mean temperature of the coil [K], shape (k,)
    wall: FloatArray  # Mean temperature of the wall [K], shape (k,)


def write_freefem(model: FieldModel, load: Load, folder: Path, *, step: float = 20.0) -> Path:
    """Write mesh, tables and script into a folder and return the path of the script.

    Parameters
    ----------
    load : thermal load, which starts at ambient temperature
    step : time step [s]; the last step ends with the load
    """
    section = model.section
    _write_mesh(model.mesh, folder / "section.msh")
    rows = [section.grid, np.asarray(load.power(section.grid), dtype=np.float64), *section.films]
    table = "\n".join(" ".join(f"{value:.12g}" for value in row) for row in rows)
    (folder / "tables.txt").write_text(table + "\n", encoding="utf-8")
    roles: dict[str, str] = {
        word: ", ".join(str(k + 1) for k, region in enumerate(section.regions) if region.role in names)
        for word, names in (
            ("GAP", ("gap",)),
            ("COIL", ("coil",)),
            ("FLUID", ("gap", "chamber")),
            ("WALL", ("wall",)),
        )
    }
    surfaces = section.surfaces

    def listed(values: list[float]) -> str:
        return "[" + ", ".join(f"{value:.15g}" for value in values) + "]"

    values = {
        "KR": listed([0.0] + [region.conductivity_r for region in section.regions]),
        "KZ": listed([0.0] + [region.conductivity_z for region in section.regions]),
        "HEAT": listed([0.0] + [region.volumetric_heat for region in section.regions]),
        "LAW": listed([0.0] + [float(surface.law) for surface in surfaces]),
        "EMISSIVITY": listed([0.0] + [surface.emissivity for surface in surfaces]),
        "MOUNT": listed([0.0] + [surface.mount for surface in surfaces]),
        "LABELS": ", ".join(str(k + 1) for k in range(len(surfaces))),
        "KNOTS": str(len(section.grid)),
        "ROWS": str(len(rows)),
        "LOW": f"{section.grid[0]:.15g}",
        "WIDTH": f"{section.grid[1] - section.grid[0]:.15g}",
        "AMBIENT": f"{section.ambient:.15g}",
        "SIGMA": f"{STEFAN_BOLTZMANN:.15g}",
        "COPPER": f"{COPPER_PER_K:.15g}",
        "COILPOWER": f"{load.coil_W:.15g}",
        "STEPS": str(max(1, math.ceil(load.duration / step - 1e-9))),
        "DURATION": f"{load.duration:.15g}",
        **roles,
    }
    text = _SCRIPT
    for name, value in values.items():
        text = text.replace(f"@{name}@", value)
    script = folder / "section.edp"
    script.write_text(text, encoding="utf-8")
    return script


def run_freefem(script: Path) -> FreefemCourse:
    """Run a script of ``write_freefem`` and read its results.

    Raises
    ------
    InputError
        FreeFem++ is not installed, or failed.
    """
    run_program("FreeFem++", ["-nw", "-ne", "-v", "0", script.name], script.parent, package="freefem++")
    field = np.loadtxt(script.parent / "field.txt")
    history = np.loadtxt(script.parent / "history.txt", ndmin=2)
    return FreefemCourse(field[:, :2], field[:, 2], *history.T)


def score_reduced(seed: int, folder: Path, *, step: float = 60.0) -> tuple[float, float]:
    """Return the RMS errors [K] of fluid and coil of the reduced model for a body, versus FreeFem++."""
    body = draw_body(seed)
    model = build_field(body.drawing)
    theirs = run_freefem(write_freefem(model, body.load, folder, step=step))
    ours = simulate_field(reduce_field(model).equation, [body.load])
    fluid, coil = (
        float(np.sqrt(np.mean((np.interp(theirs.time, ours.time, mine) - other) ** 2)))
        for mine, other in ((ours.fluid, theirs.fluid), (ours.coil, theirs.coil))
    )
    return fluid, coil


def _write_mesh(mesh: SectionMesh, path: Path) -> None:
    """Write a mesh in the format of FreeFem++. Each side of the outline has a label."""
    sides = np.sort(
        np.concatenate([mesh.triangles[:, [0, 1]], mesh.triangles[:, [1, 2]], mesh.triangles[:, [2, 0]]])
    )
    once, count = np.unique(sides, axis=0, return_counts=True)
    label = {(int(a), int(b)): _INSULATED for a, b in once[count == 1]}
    for (a, b), surface in zip(np.sort(mesh.facets, axis=1).tolist(), mesh.surface.tolist(), strict=True):
        label[a, b] = surface + 1
    lines = [f"{len(mesh.corners)} {len(mesh.triangles)} {len(label)}"]
    lines += [f"{r:.17g} {z:.17g} 0" for r, z in mesh.corners.tolist()]
    lines += [
        f"{a + 1} {b + 1} {c + 1} {region + 1}"
        for (a, b, c), region in zip(mesh.triangles.tolist(), mesh.region.tolist(), strict=True)
    ]
    lines += [f"{a + 1} {b + 1} {name}" for (a, b), name in label.items()]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


_SCRIPT = """\
// Transient heat in the meridian section of a damper; x is the radius, y the axis. SI units, kelvin.
mesh Th = readmesh("section.msh");
fespace Vh(Th, P2);
fespace Ph(Th, P0);
real[int] KR = @KR@, KZ = @KZ@, HEAT = @HEAT@;
real[int] LAW = @LAW@, EPS = @EMISSIVITY@, MOUNT = @MOUNT@;
real Ta = @AMBIENT@, sigma = @SIGMA@;

// rows: temperatures, mechanical power, film coefficients
real[int, int] table(@ROWS@, @KNOTS@);
{ ifstream file("tables.txt");
  for (int i = 0; i < @ROWS@; i++) for (int j = 0; j < @KNOTS@; j++) file >> table(i, j); }
func real look(int row, real t)
{
  real s = (t - @LOW@)/@WIDTH@;
  int k = int(s);
  assert(k >= 0 && k < @KNOTS@ - 1);
  return table(row, k) + (s - k)*(table(row, k + 1) - table(row, k));
}
func real film(int label, real t)
{
  return look(2 + int(LAW[label]), t) + EPS[label]*sigma*(t*t + Ta*Ta)*(t + Ta) + MOUNT[label];
}

Ph kr = KR[region], kz = KZ[region], heat = HEAT[region];
real gap = int2d(Th, @GAP@)(2*pi*x), winding = int2d(Th, @COIL@)(2*pi*x);
real fluid = int2d(Th, @FLUID@)(2*pi*x), wall = int2d(Th, @WALL@)(2*pi*x);

int steps = @STEPS@;
real dt = @DURATION@/steps, gamma = 1 - 1/sqrt(2.), shrunk = gamma*dt;
Vh u = Ta, known = Ta, first, old, w, v;
real power;

varf conduction(w, v)
  = int2d(Th, qforder = 6)(2*pi*x*(heat/shrunk*w*v + kr*dx(w)*dx(v) + kz*dy(w)*dy(v)))
  - int2d(Th, @COIL@, qforder = 6)(2*pi*x*@COILPOWER@/winding*@COPPER@*w*v);
varf cooling(w, v) = int1d(Th, @LABELS@, qforder = 6)(2*pi*x*film(label, u)*w*v);
varf right(w, v)
  = int2d(Th, qforder = 6)(2*pi*x*heat/shrunk*known*v)
  + int2d(Th, @GAP@)(2*pi*x*power/gap*v)
  + int2d(Th, @COIL@, qforder = 6)(2*pi*x*@COILPOWER@/winding*(1 - @COPPER@*293.15)*v)
  + int1d(Th, @LABELS@, qforder = 6)(2*pi*x*film(label, u)*Ta*v);
matrix A = conduction(Vh, Vh);

ofstream history("history.txt");
history.precision(12);
for (int n = 0; n < steps; n++)
{
  old = u;
  for (int stage = 0; stage < 2; stage++)
  {
    if (stage == 0) known = old;
    else { first = u; known = old + (1 - gamma)/gamma*(first - old); }
    real change = 1;
    for (int turn = 0; turn < 20 && change > 1e-6; turn++)
    {
      power = look(1, int2d(Th, @FLUID@)(2*pi*x*u)/fluid);
      matrix B = cooling(Vh, Vh);
      B = A + B;
      set(B, solver = sparsesolver);
      real[int] b = right(0, Vh);
      w[] = B^-1*b;
      v[] = w[] - u[];
      change = v[].linfty;
      u[] = w[];
    }
    assert(change <= 1e-6);
  }
  history << (n + 1)*dt << " " << int2d(Th, @FLUID@)(2*pi*x*u)/fluid << " "
          << int2d(Th, @COIL@)(2*pi*x*u)/winding << " " << int2d(Th, @WALL@)(2*pi*x*u)/wall << endl;
}
Vh xx = x, yy = y;
{ ofstream field("field.txt");
  field.precision(15);
  for (int i = 0; i < Vh.ndof; i++) field << xx[][i] << " " << yy[][i] << " " << u[][i] << endl; }
"""


if __name__ == "__main__":
    found = []
    first, last = (0, *map(int, sys.argv[1:]))[-2:]
    for number in odd_bodies(last)[first:]:
        with tempfile.TemporaryDirectory() as place:
            found.append(score_reduced(number, Path(place)))
        print(f"body {number}: {found[-1][0]:.3g}, {found[-1][1]:.3g} K", flush=True)
    for name, column in zip(("fluid", "coil"), np.array(found).T, strict=True):
        print(f"{name} RMS K: median {np.median(column):.3g}, worst {column.max():.3g}")
