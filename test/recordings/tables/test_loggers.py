"""Tables as loggers, spreadsheets and programs write them: the same three signals come out of each."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import pytest

from shake_ros.quantities import ShakeError
from shake_ros.recordings.tables.table import Column, ColumnTable, read_table

COUNT = 400
TIME = np.arange(COUNT) / 200.0
DRIVE = np.round(0.3 * np.sin(2.0 * np.pi * TIME) + 0.01, 6)
PLACE = np.round(1850.0 * np.sin(2.0 * np.pi * TIME) + 12.0, 3)  # [mm], beyond 1000 for the thousands
WANTED = {"time": "time", "command": "command", "position": "position"}


def rows(line: Callable[[float, float, float], str], count: int = COUNT, ending: str = "\n") -> str:
    return "".join(line(*row) + ending for row in zip(TIME[:count], DRIVE, PLACE, strict=False))


def plain(separator: str, decimal: str = ".", form: str = "{:.3f}{s}{:.6f}{s}{:.3f}") -> Callable[..., str]:
    return lambda *row: form.format(*row, s="\0").replace(".", decimal).replace("\0", separator)


def german(value: float, digits: int) -> str:
    return f"{value:,.{digits}f}".translate(str.maketrans(",.", ".,"))


def french(value: float, digits: int) -> str:
    return f"{value:,.{digits}f}".replace(",", "\u202f").replace(".", ",")


def swiss(value: float, digits: int) -> str:
    return f"{value:,.{digits}f}".replace(",", "'")


def localised(form: Callable[[float, int], str], separator: str) -> Callable[..., str]:
    return lambda t, u, x: separator.join((form(t, 3), form(u, 6), form(x, 3)))


def of_day(t: float) -> str:
    return f"23:59:{59 + t:06.3f}" if t < 1.0 else f"00:00:{t - 1.0:06.3f}"


LVM = """LabVIEW Measurement\t
Writer_Version\t2
Reader_Version\t2
Separator\tTab
Decimal_Separator\t,
Multi_Headings\tYes
X_Columns\tOne
Time_Pref\tRelative
Operator\tlab
Date\t2024/05/02
Time\t10:22:11,123456
***End_of_Header***\t
\t
Channels\t2\t
Samples\t400\t400\t
Date\t2024/05/02\t2024/05/02\t
Time\t10:22:11,2\t10:22:11,2\t
Y_Unit_Label\tV\tmm\t
X_Dimension\tTime\tTime\t
X0\t0,0000000000000000E+0\t0,0000000000000000E+0\t
Delta_X\t0,005000\t0,005000\t
***End_of_Header***\t\t\t
X_Value\tValve\tDisp\tComment
"""
CATMAN = """HBM_CATMAN_DATAFILE_40
Versuch: Rütteltisch
Datum:\t02.05.2024 10:22:11
Kanalanzahl:\t3
Werte je Kanal:\t400
Kanal\tBereich\tVerstärker
1\t10,0\tMX840
2\t50,0\tMX840

Zeit  1 - Standardmessrate [s]\tVentil [V]\tWeg [mm]
"""
DEWESOFT = """File name: run_0001.dxd
Number of channels: 2
Sample rate: 200
Store date: 5/2/2024 10:22:11.123 AM

Time (s)\tAI 1/Valve (V)\tAI 2/Disp (mm)\t
"""
BLUEHILL = """"Results Table 1"
"","Maximum Load","Extension at Break"
"","(kN)","(mm)"
"1","12.3","4.5"
"2","12.9","4.1"

"Raw data"
"Time","Valve","Disp"
"(s)","(V)","(mm)"
"""
EXPRESS = """waveform\t[0]\t[1]
t0\t02.05.2024 10:22:11,123\t02.05.2024 10:22:11,123
delta t\t0,005000\t0,005000

time\tValve [V]\tDisp [mm]
"""

FILES: dict[str, str] = {
    "pandas_with_index": ",Time [s],Valve,Disp [mm]\n"
    + "".join(f"{k},{t},{u},{x}\n" for k, (t, u, x) in enumerate(zip(TIME, DRIVE, PLACE, strict=True))),
    "r_row_names": '"Time [s]" "Valve" "Disp [mm]"\n'
    + "".join(f'"{k + 1}" {t} {u} {x}\n' for k, (t, u, x) in enumerate(zip(TIME, DRIVE, PLACE, strict=True))),
    "matlab_writetable": "Time_s_,Valve,Disp_mm_\n" + rows(plain(",", form="{:.15g}{s}{:.15g}{s}{:.15g}")),
    "excel_german": "Zeit [s];Ventil [V];Weg [mm]\r\n" + rows(localised(german, ";"), ending="\r\n"),
    "excel_french": "Temps (s);Vanne (V);Déplacement (mm)\r\n" + rows(localised(french, ";"), ending="\r\n"),
    "excel_swiss": "Zeit [s];Ventil [V];Weg [mm]\n" + rows(localised(swiss, ";")),
    "excel_sep_hint": "sep=;\r\nZeit [s];Ventil;Weg [mm]\r\n" + rows(plain(";", ","), ending="\r\n"),
    "excel_english_in_quotes": "Time [s],Valve,Disp [mm]\n" + rows(lambda t, u, x: f'{t:.3f},{u:.6f},"{x:,.3f}"'),
    "chinese": "时间（s）,阀（V）,位移（mm）\n" + rows(plain(",")),
    "italian": "Tempo [s];Valvola [V];Spostamento [mm]\n" + rows(plain(";", ",")),
    "labview_lvm": LVM + rows(plain("\t", ",", "{:.6f}{s}{:.6f}{s}{:.6f}")),
    "labview_lvm_with_comment": (LVM + rows(plain("\t", ",", "{:.6f}{s}{:.6f}{s}{:.6f}"))).replace(
        "\n0,005000\t", "\n0,005000\t", 1
    ),
    "catman": CATMAN + rows(plain("\t", ",")),
    "dewesoft": DEWESOFT + rows(plain("\t")).replace("\n", "\t\n"),
    "bluehill_with_results_above": BLUEHILL + rows(lambda t, u, x: f'"{t:.3f}","{u:.6f}","{x:.3f}"'),
    "signal_express": EXPRESS + rows(plain("\t", ",")),
    "names_in_comment": "# rig 3\n# Time [s], Valve, Disp [mm]\n" + rows(plain(",")),
    "names_in_percent_comment": "% Time(s) Valve(-) Disp(mm)\n" + rows(plain(" ")),
    "fixed_width": f"{'Time (s)':>12}{'Valve (V)':>12}{'Disp (mm)':>14}\n"
    + rows(lambda t, u, x: f"{t:12.3f}{u:12.6f}{x:14.3f}"),
    "blank_separated_names_with_units": "Time (s) Valve (V) Disp (mm)\n" + rows(plain(" ")),
    "units_in_brackets_below": "Time;Valve;Disp\n[s];[V];[mm]\n" + rows(plain(";", ",")),
    "units_above_names": "s,V,mm\nTime,Valve,Disp\n" + rows(plain(",")),
    "three_rows_of_heading": "Time,Valve,Disp\ns,V,mm\nCH1,CH2,CH3\n" + rows(plain(",")),
    "group_above_names": "Rig 1,,\nTime,Valve,Disp\ns,V,mm\n" + rows(plain(",")),
    "heading_in_two_lines_of_one_cell": '"Time\n[s]","Valve\n[V]","Disp\n[mm]"\n' + rows(plain(",")),
    "trailing_separator_everywhere": "Time [s];Valve;Disp [mm];\n" + rows(plain(";")).replace("\n", ";\n"),
    "two_trailing_separators": "Time [s],Valve,Disp [mm]\n" + rows(plain(",")).replace("\n", ",,\n"),
    "blank_line_under_names": "Time [s],Valve,Disp [mm]\n\n" + rows(plain(",")),
    "statistics_below": "Zeit [s];Ventil;Weg [mm]\n" + rows(plain(";", ",")) + "\nMin;-0,29;-1838\nMax;0,31;1862\n",
    "footer_of_text": "Time [s]\tValve\tDisp [mm]\n" + rows(plain("\t")) + "Test stopped by operator at 10:22\n",
    "heading_every_100_rows": "".join(
        "Time [s],Valve,Disp [mm]\n" + "".join(rows(plain(",")).splitlines(keepends=True)[k : k + 100])
        for k in range(0, COUNT, 100)
    ),
    "page_breaks": "".join(
        f"\nPage {k // 100 + 1}\nTime\tValve\tDisp\ns\tV\tmm\n"
        + "".join(rows(plain("\t")).splitlines(keepends=True)[k : k + 100])
        for k in range(0, COUNT, 100)
    ),
    "time_in_ms": "Time [ms],Valve,Disp [mm]\n" + rows(lambda t, u, x: f"{1000 * t:g},{u:.6f},{x:.3f}"),
    "time_in_us": "t_us;Valve;Disp [mm]\n" + rows(lambda t, u, x: f"{1e6 * t:.0f};{u:.6f};{x:.3f}"),
    "time_in_minutes": "Time (min);Valve;Disp [mm]\n" + rows(lambda t, u, x: f"{t / 60:.9f};{u:.6f};{x:.3f}"),
    "time_of_day_over_midnight": "Time;Valve;Disp [mm]\n" + rows(lambda t, u, x: f"{of_day(t)};{u:.6f};{x:.3f}"),
    "date_and_time": "Timestamp,Valve,Disp [mm]\n"
    + rows(lambda t, u, x: f"2024-05-02T10:22:{t:06.3f}Z,{u:.6f},{x:.3f}"),
    "date_and_time_german": "Datum/Zeit;Ventil;Weg [mm]\n"
    + rows(lambda t, u, x: f"02.05.2024 10:22:{t:06.3f};{u:.6f};{x:.3f}".replace(".", ",").replace("02,05,", "02.05.")),
    "date_beside_time": "Date,Time,Valve,Disp [mm]\n"
    + rows(lambda t, u, x: f"5/2/2024,10:22:{t:06.3f},{u:.6f},{x:.3f}"),
    "position_in_um": "Time [s],Valve,Disp [µm]\n" + rows(lambda t, u, x: f"{t:.3f},{u:.6f},{1000 * x:.0f}"),
    "position_in_inch": "Time [s],Valve,Disp (in)\n" + rows(lambda t, u, x: f"{t:.3f},{u:.6f},{x / 25.4:.9f}"),
    "text_column": "Time [s],State,Valve,Disp [mm]\n" + rows(lambda t, u, x: f"{t:.3f},RUN,{u:.6f},{x:.3f}"),
    "event_column_filled_now_and_then": "Time [s],Valve,Disp [mm],Event\n"
    + rows(lambda t, u, x: f"{t:.3f},{u:.6f},{x:.3f},{'start' if t == 0.5 else ''}"),
    "exponents": "Time [s],Valve,Disp [mm]\n" + rows(lambda t, u, x: f"{t:.8E},{u:+.8E},{x:.8E}"),
    "fortran": "   Time(s)   Valve(-)   Disp(mm)\n"
    + rows(lambda t, u, x: f" {t:.8E} {u:.8E} {x:.8E}".replace("E", "D")),
    "minus_of_typesetters": "Time [s];Valve;Disp [mm]\n" + rows(plain(";")).replace("-", "\u2212"),
    "all_in_quotes": '"Time [s]";"Valve";"Disp [mm]"\n'
    + rows(lambda t, u, x: ";".join(f'"{v}"'.replace(".", ",") for v in (f"{t:.3f}", f"{u:.6f}", f"{x:.3f}"))),
    "pipes": "Time [s]|Valve|Disp [mm]\n" + rows(plain("|")),
    "comma_and_blank": "Time [s], Valve, Disp [mm]\n" + rows(plain(", ")),
    "tab_and_blanks": "Time [s] \t Valve \t Disp [mm]\n" + rows(plain(" \t ")),
    "old_mac": "Time [s],Valve,Disp [mm]\r" + rows(plain(","), ending="\r"),
    "no_last_line_end": "Time [s],Valve,Disp [mm]\n" + rows(plain(",")).rstrip("\n"),
    "dos_end_mark": "Time [s],Valve,Disp [mm]\r\n" + rows(plain(","), ending="\r\n") + "\x1a",
    "long_preamble": "".join(f"Parameter {k}: {k / 7:.4f} kN, {k}\n" for k in range(120))
    + "Time [s],Valve,Disp [mm]\n"
    + rows(plain(",")),
    "mts_793": "MTS793|MPT|DEU|1|2|,|.|:|1|0|0|A\n\n"
    "Datenerfassung:\tZeitgesteuert\t4,5\tSek\nTime\tValve\tDisp\nSec\tV\tmm\n" + rows(plain("\t", ",")),
}
PLACES = {
    "pandas_with_index": ("Time [s]", "Valve", "Disp [mm]"),
    "excel_french": ("Temps (s)", "Vanne (V)", "Déplacement (mm)"),
    "chinese": ("时间", "阀", "位移"),
    "italian": ("Tempo", "Valvola", "Spostamento"),
    "dewesoft": ("Time", "AI 1/Valve (V)", "AI 2/Disp (mm)"),
    "catman": ("1", "2", "3"),
    "matlab_writetable": ("Time_s_", "Valve", "Disp_mm_"),
    "labview_lvm": ("X_Value", "Valve", "Disp"),
    "labview_lvm_with_comment": ("X_Value", "Valve", "Disp"),
    "time_in_us": ("t_us", "Valve", "Disp"),
    "date_and_time": ("Timestamp", "Valve", "Disp"),
    "date_and_time_german": ("Datum/Zeit", "Ventil", "Weg"),
    **dict.fromkeys(("excel_german", "excel_swiss", "excel_sep_hint", "statistics_below"), ("Zeit", "2", "Weg")),
}


def three(table: ColumnTable, columns: Iterable[str]) -> list[np.ndarray]:
    named = dict(zip(WANTED, map(Column.parse, columns), strict=True))
    return [signal.values for signal in table.signals(named, WANTED).values()]


@pytest.mark.parametrize("name", FILES)
def test_the_same_signals_come_out_of_every_logger(tmp_path: Path, name: str) -> None:
    file = tmp_path / "run.txt"
    file.write_text(FILES[name], encoding="utf-8", newline="")
    time, command, position = three(read_table(file), PLACES.get(name, ("Time", "Valve", "Disp")))
    assert np.allclose(time - time[0], TIME, atol=2e-9)
    assert np.allclose(command, DRIVE, atol=1e-12)
    assert np.allclose(position, 1e-3 * PLACE, atol=1e-9)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "cp1252", "latin-1"])
def test_every_encoding_of_a_german_heading(tmp_path: Path, encoding: str) -> None:
    file = tmp_path / "run.csv"
    file.write_bytes(("Zeit [s];Größe [V];Weg [µm]\n" + rows(plain(";", ","))).encode(encoding))
    time, command, position = three(read_table(file), ("Zeit", "größe", "Weg [µm]"))
    assert np.array_equal(time, TIME)
    assert np.array_equal(command, DRIVE)
    assert np.allclose(position, 1e-6 * PLACE, rtol=1e-12)


@pytest.mark.parametrize(
    ("encoding", "heading"),
    [
        ("gbk", "时间(s),阀门(V),位移(mm)"),
        ("gb18030", "时间(秒)，阀"),
        ("cp1251", "Время (с);Клапан (В);Перемещение (мм)"),
    ],
)
def test_headings_in_other_scripts(tmp_path: Path, encoding: str, heading: str) -> None:
    file = tmp_path / "run.csv"
    heading = heading if heading.count(",") + heading.count(";") == 2 else "时间(秒),阀门(伏),位移(毫米)"
    file.write_bytes((heading + "\n" + rows(plain(";" if ";" in heading else ","))).encode(encoding))
    time, _, position = three(read_table(file), ("1", "2", "3"))
    assert np.array_equal(time, TIME)
    assert np.allclose(position, 1e-3 * PLACE, rtol=1e-12)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("Time;Disp\n" + "".join(f"{k};1,{100 + k}\n" for k in range(50)), "'1,100' may be a thousand or a decimal"),
        ("Disp\n" + "".join(f"1,{100 + k}\n" for k in range(50)), "may be a thousand or a decimal|one column or two"),
        ("".join(f"{k},{100 + k}\n" for k in range(50)), "one column of decimal commas or two columns"),
        (
            "Time;Disp\n" + "".join(f"{k}.5;{k},5\n" for k in range(50)),
            "a decimal point, '0.5', another a decimal comma",
        ),
        (
            "Time,Disp\n" + "".join(f"{k},{k}\n" if k != 7 else "7\n" for k in range(50)),
            "line 9 has 1 columns, 2 are needed",
        ),
        ("Time,Disp\n" + "".join(f"{k},{k}\n" if k != 7 else "7,7,7\n" for k in range(50)), "line 9 has 3 columns"),
        (
            "Time,Disp\n" + "".join(f"{k},{k}\n" if k != 7 else "7,over\n" for k in range(50)),
            "line 9, column 'Disp' holds 'over'",
        ),
        ("PK\x03\x04", "is not a readable Excel file"),
        ("%PDF-1.4", "is a PDF"),
        ("\x1f\x8b", "is a gzip archive: unpack it"),
        ("\xd0\xcf\x11\xe0", "old Excel file"),
        ("TDSm" + "\x00" * 40, "is not a readable TDMS file"),
    ],
)
def test_what_cannot_be_decided_or_read_is_one_line(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "run.csv"
    file.write_bytes(text.encode("latin-1"))
    with pytest.raises(ShakeError, match=words) as refused:
        read_table(file).read([0, 1])
    assert str(refused.value).startswith(str(file))
    assert "\n" not in str(refused.value)


def test_a_decimal_sign_that_is_given_decides(tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    file.write_text("Time;Disp\n" + "".join(f"{k};1,{100 + k}\n" for k in range(50)))
    assert read_table(file, decimal=",").read([1])[0][0] == 1.1
    assert read_table(file, decimal=".").read([1])[0][0] == 1100.0
