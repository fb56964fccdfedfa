"""Search heat sinks for a damper: fluid temperature after half an hour versus mass of the fins.

python examples/heat_sink_study.py CARD [DRAWING]    (DRAWING: geometry file; default: damper of the reference
paper)
"""

import sys
from dataclasses import replace

from mrdamper.models.card_schema import read_card
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.duty import read_duty
from mrdamper.thermal.sinks.design import HeatedDamper, lightest_as_cool, limits_of, search_grid
from mrdamper.thermal.temperature_rise import loads_of, works_of

card, drawing = read_card(sys.argv[1]), read_drawing(sys.argv[2] if len(sys.argv) > 2 else "paper")
duty = read_duty("sine:15mm:1Hz:2A:1800s")
damper = HeatedDamper(drawing, tuple(loads_of(works_of(card.damper, duty), drawing, duty)))
reference = damper.evaluate(drawing.sink)
print(f"bare {damper.evaluate(None).fluid - 273.15:.1f} degC")
print(f"as drawn {reference.fluid - 273.15:.1f} degC, {1e3 * reference.mass:.0f} g")

for least_mm in (1.0, 2.0, 3.0):
    limits = replace(limits_of(drawing), least_thickness=1e-3 * least_mm)
    front = search_grid(damper, limits)
    as_cool = lightest_as_cool(front.designs, reference.fluid)
    lightest = "none as cool" if as_cool is None else f"as cool from {1e3 * as_cool.mass:.0f} g"
    print(f"fins of {least_mm:g} mm or more: coolest {front.best.fluid - 273.15:.1f} degC; {lightest}")
