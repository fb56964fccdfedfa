"""Files in the layouts of instruments and programs are read. An unclear file leads to a question.

Examples are channel lists, a row per sample and channel, a file per channel, percentages and dates.
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from scipy.io import savemat

from mrdamper.data.formats.timestamps import moment_of, seconds_of
from mrdamper.data.proposal.clocks import unit_by_magnitude
from mrdamper.data.proposal.questions import AskingError
from mrdamper.data.readers import read_runs
from mrdamper.data.records import RigRun
from tests.data.test_laboratories import CURRENTS, RUNS, assert_read
from tests.data.test_unseen_layouts import BARE, columns, each, table, write

UNITS = ("mm", "N", "A")
SCOPE = "CH1: LVDT, 1 V = 5 mm\nCH2: load cell, 500 N/V\nCH3: current clamp, 100 mV/A\n"


def samples(run: RigRun, sign: str = ",", form: str = "%.6f", point: str = ".") -> str:
    """Return displacement, force and current as lines of text, without a time."""
    return table(*columns(run)[1:], sign=sign, form=form).replace(".", point)


def counts(run: RigRun) -> str:
    x, f, i = columns(run)[1:]
    return table((x + 2.5) / 1e-6, (f - 12.5) / 1e-3, i / 0.01, sign=";", form="%.0f")


def readings(run: RigRun, sign: str = ";", zeros: tuple[float, ...] = (0.3, 0.02, 5e-3)) -> str:
    """Return volts of three sensors: samples divided by their gain, plus the reading without load."""
    values = zip(columns(run)[1:], (2.5, -2500.0, 0.2), zeros, strict=True)
    return table(*(each / gain + zero for each, gain, zero in values), sign=sign, form="%.9f")


GAINS = (
    "Rate [Hz];200\nNo;Name;Unit;Gain;Zero\n1;Stroke;mm;2.5;0.3\n2;Load;N;-2500;0.02\n3;Coil;A;0.2;0.005\n"
)
FACTORS = "Vzorkování;200 Hz\nKanál;1;2;3\nNázev;Zdvih; Síla;Proud\nJednotka;mm;N;A\n"


def files(text: Callable[[str, str, np.ndarray], str], form: str) -> Callable[[Path], None]:
    """Return a writer of one file for each channel; the text depends on name, unit and samples."""

    def writer(folder: Path) -> None:
        for k, run in enumerate(RUNS):
            for name, unit, values in zip(("ut", "ero", "aram"), UNITS, columns(run)[1:], strict=True):
                step = 20 if unit == "A" else 1
                write(folder, form.format(k + 1, name), text(name, unit, values[::step]))

    return writer


def interval_ms(unit: str) -> int:
    return 100 if unit == "A" else 5


def scope(folder: Path, notes: str = SCOPE) -> None:
    """Write a file per channel as an oscilloscope does: settings, then time and voltage, in each row."""
    for k, run in enumerate(RUNS):
        t, x, f, i = columns(run)
        for channel, volts in enumerate((x / 5.0, f / 500.0, i * 0.1), 1):
            entries = [f"Source,CH{channel}", "Vertical Units,V", "Vertical Scale,0.5", "Horizontal Units,s"]
            entries += [","] * (len(t) - len(entries))
            lines = zip(entries, table(t - 1.0, volts, form="%.9f").splitlines(), strict=True)
            write(folder, f"F{k:04d}CH{channel}.CSV", "".join(f"{a},,{b},\n" for a, b in lines))
    write(folder, "channels.txt", notes)


def long_rows(form: Callable[[int, str, float], str]) -> str:
    """Return a row for each sample of each channel: the cells that ``form`` returns, then the value."""
    names = ("rod_position_mm", "rod_force_N", "coil_current_A")
    return "".join(
        f"{form(k, name, t)},{value:.6f}\n"
        for k, run in enumerate(RUNS)
        for name, values in zip(names, columns(run)[1:], strict=True)
        for t, value in zip(run.time, values, strict=True)
    )


def moment(k: int, t: float) -> datetime:
    return datetime(2024, 1, 18, 8, 12) + timedelta(minutes=k, seconds=float(t))


def influx(folder: Path) -> None:
    head = "#group,false,false,true,false,true,true,false\n#datatype,string,long,dateTime:RFC3339,"
    head += "dateTime:RFC3339,string,string,double\n#default,_result,,,,,,\n"
    head += ",result,table,_start,_time,_field,run,_value\n"
    rows = long_rows(
        lambda k, name, t: (
            f",,{5 * k + len(name) % 5},2024-01-18T08:00:00Z,"
            f"{moment(k, t).isoformat('T', 'milliseconds')}Z,"
            f"{name},R{k}"
        )
    )
    write(folder, "query.csv", head + rows)


def epoch(folder: Path) -> None:
    rows = long_rows(lambda k, name, t: f"damper,{name},{k},{1705565520000 + 60000 * k + round(1e3 * t)}")
    write(folder, "export.csv", "measurement,variable,test,time,value\n" + rows)


def beside_on_a_sheet(folder: Path) -> None:
    from openpyxl import Workbook

    for run, current in zip(RUNS, CURRENTS, strict=True):
        book = Workbook()
        notes = [["Operator", "Lee"], ["Coil current", f"{current} A"], ["Motion", "sine"]]
        book.active.append(["Time [s]", "Stroke [mm]", "Load [N]"])
        for k, row in enumerate(zip(*columns(run)[:3], strict=True)):
            book.active.append([*map(float, row), None, *(notes[k] if k < len(notes) else [])])
        book.save(folder / f"{current}.xlsx")


def per_cent(run: RigRun) -> str:
    head = "MESSRATE 200 HZ\nKANAL 1 WEG MESSBEREICH 25 MM\nKANAL 2 KRAFT MESSBEREICH 2 KN\n"
    head += "KANAL 3 STROM MESSBEREICH 2 A\nALLE WERTE IN PROZENT VOM MESSBEREICH\n\nNR;WEG;KRAFT;STROM\n"
    _, x, f, i = columns(run)
    return head + table(np.arange(len(x)), x / 0.25, f / 20.0, i / 0.02, sign=";", form="%.7f")


def matrices(
    folder: Path, names: tuple[str, ...] = ("run1", "run2", "run3"), form: Literal["5", "4"] = "5"
) -> None:
    """Write a matrix for each run, and vectors with one value for each run."""
    held = {"I_coil_A": np.array(CURRENTS), "fs_Hz": np.full(3, 200.0)}
    whole = {name: np.column_stack(columns(run)[1:3]) for name, run in zip(names, RUNS, strict=True)}
    savemat(folder / "day.mat", whole | held | {"labels": ["Stroke [mm]", "Load [N]   "]}, format=form)


def archive(folder: Path) -> None:
    whole: dict[str, Any] = {f"test_{k}": np.column_stack(columns(run)[:3]) for k, run in enumerate(RUNS)}
    names = np.array(["time_s", "disp_mm", "force_N"])
    np.savez(folder / "day.npz", **whole, columns=names, current_A=np.array(CURRENTS))


def numbered(run: RigRun, first: str, last: str) -> str:
    """Return the counts of two of three channels, which a table describes by their numbers."""
    head = f"Corrente bobina;{run.command[0]:g} A\nFrequenza di campionamento;200 Hz\n"
    head += "Valore = (conteggio - offset) * fattore\n\nCanale;Nome;Unità;Fattore;Offset\n"
    head += "3;Forza;N;-0,001;2031\n2;Olio;°C;0,1;0\n1;Corsa;mm;0,000001;2048\n\nDati\n"
    x, f = np.round(1e6 * columns(run)[1]) + 2048, np.round(-1000 * columns(run)[2]) + 2031
    values = {"Canale 1": x, "Canale 3": f}
    return f"{head}{first};{last}\n" + table(values[first], values[last], sign=";", form="%.0f")


def shares(run: RigRun, head: str) -> str:
    values = zip(columns(run)[:3], (1.0, 0.25, 20.0), strict=True)
    text = table(*(each / full for each, full in values), run.command, form="%.9f")
    above = "".join(f"# {line}\n" for line in head.splitlines())
    return f"{above}time_s,stroke_pct,force_pct,coil_A\n{text}"


def ranges_in_a_document(folder: Path) -> None:
    each(lambda run: shares(run, ""))(folder)
    write(folder, "README.txt", "stroke range 25 mm\nforce range 2 kN\n")


def fortran(run: RigRun, step: str) -> str:
    rows = table(*columns(run)[1:3], sign="  ", form="%.9E").replace("E", "D")
    return f" COIL CURRENT = {run.command[0]:.2f} AMP\n {step}\n  DISPL (MM)  FORCE (N)\n{rows}"


LAYOUTS: dict[str, Callable[[Path], None]] = {
    "units_as_names_and_a_cut_last_row": each(
        lambda run: "bench v0.7\ntare... done\ns,mm,N,A\n" + table(*columns(run)) + "5.0,-9."
    ),
    "channels_by_number": each(lambda run: numbered(run, "Canale 1", "Canale 3")),
    "channels_by_number_in_other_order": each(lambda run: numbered(run, "Canale 3", "Canale 1")),
    "per_cent_in_names": each(
        lambda run: shares(
            run,
            "stroke_pct: per cent of range, range 25 mm\nforce_pct: per cent of range, range 2 kN\n"
            "coil_A: ampere",
        )
    ),
    "per_cent_with_ranges_in_a_document": ranges_in_a_document,
    "step_and_count": each(lambda run: fortran(run, "NPTS = 400   DT = 5.0D-03 SEC"), "TEST.R0{}"),
    "step_after_count": each(lambda run: fortran(run, "NPTS= 400, DT= .0050 SEC")),
    "list_of_names_with_commas": each(
        lambda run: (
            '"Setup","Damper, MR-7"\n"Sample rate:","200 Hz"\n"1","Stroke, rod","mm",-15.2\n'
            '"2","Load, cell 5 kN","N",-310.5\n"3","Coil, clamp","A",0.01\n"Data1"\n' + samples(run)
        )
    ),
    "list_with_the_time": each(
        lambda run: (
            "Nr;Bezeichnung;Einheit;Bereich\n0;Zeit;s;\n1;Weg;mm;50\n2;Kraft;N;10\n3;Strom;A;5\nMesswerte\n"
            + table(*columns(run), sign=";").replace(".", ",")
        )
    ),
    "rows_in_another_language": each(
        lambda run: (
            "Örnekleme (sampling);200 Hz\nAd;Konum; uç;Kuvvet\nBirim;mm;N\n".replace("; uç", " uç")
            + f"Akım [A];{run.command[0]}\n"
            + table(*columns(run)[1:3], sign=";").replace(".", ",")
        )
    ),
    "rows_of_factors": each(
        lambda run: FACTORS + "Faktor;1e-6;1e-3;0,01\nOffset;-2,5;12,5;0\n" + counts(run)
    ),
    "conditions_in_a_row_for_each_column": each(
        lambda run: (
            f"Spulenstrom;{run.command[0]};A\nVorkraft;12;N\nNennhub;50;mm\n\nZeit;Weg;Kraft\ns;mm;N\n"
            + table(*columns(run)[:3], sign=";")
        )
    ),
    "equation_of_gain_and_zero": each(
        lambda run: GAINS + "physical = Gain * (reading - Zero)\nU0;U1;U2\n" + readings(run)
    ),
    "keywords_without_colon": each(
        lambda run: (
            "SERIES Stroke,Load,Coil\nRATE 200\nVERT_UNITS mm,N,A\nSLOPE 2.5,-2500,0.2\n"
            "Y_OFFSET -0.75,50,-0.001\nHORZ_UNITS Sec\nREM value = SLOPE * number + Y_OFFSET\nDATA\n"
            + readings(run, ",")
        )
    ),
    "annotated_query": influx,
    "milliseconds_since_1970": epoch,
    "header_and_values": files(
        lambda name, unit, values: (
            f"Channel: {name}\nUnit: {unit}\nSample interval: {interval_ms(unit)} ms\n\n"
            + table(values).replace(".", ",")
        ),
        "m{}-{}.asc",
    ),
    "index_and_value": files(
        lambda name, unit, values: (
            f"Signal;{name}\nEinheit;{unit}\nAbtastzeit;{interval_ms(unit)} ms\nIndex;Wert\n"
            + table(np.arange(float(len(values))), values, sign=";")
        ),
        "{1}_{0:03d}.txt",
    ),
    "screens_of_a_scope": scope,
    "notes_beside_on_a_sheet": beside_on_a_sheet,
    "per_cent_of_ranges": each(per_cent, "LAUF.{:03d}"),
    "matrices_with_vectors": matrices,
    "matrices_of_matlab_4": lambda folder: matrices(folder, form="4"),
    "matrices_of_an_archive": archive,
    "days_of_excel": each(
        lambda run: (
            "Date/Time,Stroke mm,Load N,Coil A\n"
            + "".join(
                f"{44634.5 + t / 86400.0:.12f},{line}\n"
                for t, line in zip(run.time, samples(run).splitlines(), strict=True)
            )
        )
    ),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_layout_of_instrument_is_read(tmp_path, layout):
    LAYOUTS[layout](tmp_path)
    assert_read(read_runs(tmp_path))


@pytest.mark.parametrize(
    ("line", "warm"),
    [
        *(("DS18B20: 31.25 C", 304.4), ("PT100 = 31.25 C", 304.4), ("MAX6675 (type K) 31.25 C", 304.4)),
        *(("All tests at room temperature (31.25 °C)", 304.4), ("Room temperature: 31.25 °C", None)),
        *(("Thermocouple type K, class 1, 1200 C", None), ("NTC: 0..100 C", None)),
    ],
)
def test_value_of_temperature_sensor_is_temperature(tmp_path, line, warm):
    each(lambda run: f"{line}\nCoil: {run.command[0]} A\n{BARE}{table(*columns(run)[:3])}")(tmp_path)
    assert_read(read_runs(tmp_path), warm=warm)


def two_sensors(folder: Path) -> None:
    """Write a table with one row per sample and channel. Two sensors have the same channel name."""
    x, f, i = columns(RUNS[1])[1:]
    series = (("force_N", "A", f), ("force_N", "B", 2.0 * f), ("rod_mm", "C", x), ("coil_A", "D", i))
    rows = (
        f"{name},{serial},{t:.3f},{value:.4f}\n"
        for name, serial, values in series
        for t, value in zip(RUNS[1].time, values, strict=True)
    )
    write(folder, "all.csv", "channel,serial,t_s,value\n" + "".join(rows))


UNCLEAR: dict[str, Callable[[Path], None]] = {
    "unknown_rows_of_factors": each(lambda run: FACTORS + "Konst;1e-6;1e-3;0,01\n" + counts(run)),
    "other_equation": each(
        lambda run: "value = (code - offset) * factor\n" + FACTORS + "Faktor;1e-6;1e-3;0,01\n" + counts(run)
    ),
    "equation_without_its_offset": each(
        lambda run: GAINS.replace("Zero", "Serial") + "value = Gain * (code - Zero)\n" + readings(run)
    ),
    "equation_of_other_direction": each(
        lambda run: (
            "code = Faktor * value + Offset\n"
            + (FACTORS + "Faktor;1e-6;1e-3;0,01\nOffset;-2,5;12,5;0\n" + counts(run))
        )
    ),
    "equation_already_applied": each(
        lambda run: GAINS + "Already applied: value = Gain * (code - Zero)\n" + readings(run)
    ),
    "list_of_more_channels": each(
        lambda run: "200 Hz\n1;Stroke;mm\n2;Load;N\n3;Coil;A\n4;Oil;degC\nData\n" + samples(run, ";")
    ),
    "channel_of_two_sensors": two_sensors,
    "scope_without_scales": lambda folder: scope(folder, "four screens\n"),
    "scope_with_two_scales": lambda folder: scope(folder, SCOPE + "CH2, new amplifier: 250 N/V\n"),
    "per_cent_of_no_range": each(lambda run: "Rate 200 Hz\n" + per_cent(run)[per_cent(run).index("ALLE") :]),
    "per_cent_of_a_range_with_two_ends": each(
        lambda run: shares(run, "stroke range: 10 to 35 mm\nforce range: 2 kN")
    ),
    "step_and_other_rate": each(lambda run: fortran(run, "FS = 200 HZ   DT = 0.004 SEC")),
    "vector_of_unnumbered_runs": lambda folder: matrices(folder, ("low", "mid", "high")),
}


@pytest.mark.parametrize("layout", UNCLEAR)
def test_unclear_layout_leads_to_question(tmp_path, layout):
    UNCLEAR[layout](tmp_path)
    with pytest.raises(AskingError):
        read_runs(tmp_path)


@pytest.mark.parametrize(
    "spelled",
    [
        *("2021.03.04. 14:22:57:010", "2021. 3. 4. 14:22:57.010", "4.3.2021 14.22.57,010"),
        *("4. März 2021 14:22:57,010", "4 mars 2021 14:22:57,010", "4 de marzo de 2021 14:22:57,010"),
        *("04-Mar-2021 14:22:57.010", "Mar 4, 2021 02:22:57.010 PM", "04/Mar/2021:14:22:57.010"),
        *("2021年3月4日 14:22:57.010", "2021/03/04 下午 2:22:57.010", "4-мар-2021 2:22:57.010 p. m."),
    ],
)
def test_date_notation_gives_same_moment(spelled):
    found = moment_of(spelled)
    assert found is not None
    assert found.day_first_s == pytest.approx(datetime(2021, 3, 4, 14, 22, 57, 10000).timestamp(), abs=86400)
    assert seconds_of([spelled, spelled.replace("010", "020")])[0] == pytest.approx([0.0, 0.01], abs=1e-6)


@pytest.mark.parametrize(
    ("first", "ticks", "unit"),
    [
        *(
            (44634.5, 1 / 86400, "d"),
            (738594.5, 1 / 86400, "d"),
            (1.6472e9, 1.0, "s"),
            (1.6472e12, 1e3, "ms"),
        ),
        *((1.6472e18, 1e9, "ns"), (0.0, 1.0, ""), (44634.5, 1.0, ""), (1.6472e9, 1e3, "")),
    ],
)
def test_size_of_numeric_dates_gives_unit(first, ticks, unit):
    """Times since year 0, 1900 or 1970 have a typical size. Times since another event have no known unit."""
    assert unit_by_magnitude(first + ticks * np.arange(0.0, 4.0, 0.005)) == unit


def test_time_since_unknown_start_requires_unit(tmp_path):
    """The column ``ticks`` counts from an unknown moment, in any unit."""
    for k, run in enumerate(RUNS):
        t, *values = columns(run)
        write(tmp_path, f"{k}.csv", "ticks," + BARE.split(",", 1)[1] + table(3e5 + t, *values[:2]))
    with pytest.raises(AskingError):
        read_runs(tmp_path)
