"""Readers of robot files, written from the languages' grammars and not from our writers.

Each refuses any line it does not know, and turns numbers into a pose with SciPy as the vendor
defines them.
"""

from __future__ import annotations

import csv
import io
import re
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from boltpose.arrays import FloatArray

POINTS = ("approach", "contact", "retreat")
_NUMBER = r"-?\d+\.\d+"


@dataclass
class ReadFile:
    """Every pose that a controller finds, as 4x4 in mm."""

    poses: dict[str, list[FloatArray]] = field(default_factory=lambda: {p: [] for p in POINTS})
    comments: list[str] = field(default_factory=list)
    scan_id: str = ""
    count: int = -1
    raw: list[tuple[float, ...]] = field(default_factory=list)

    @property
    def head(self) -> str:
        return " ".join(" ".join(self.comments).split())


def pose(rotation: Rotation, xyz_mm) -> FloatArray:
    matrix = np.eye(4)
    matrix[:3, :3] = rotation.as_matrix()
    matrix[:3, 3] = xyz_mm
    return matrix


def read_urscript(content: bytes) -> ReadFile:
    """Run the file: assign globals, then call every function with every number."""
    read = ReadFile()
    values: dict[str, object] = {}
    functions: dict[str, dict[int, str]] = {}
    lines = iter(content.decode("ascii").split("\n"))
    for line in lines:
        if not line.strip():
            continue
        if line.startswith("#"):
            read.comments.append(line[1:].strip())
        elif match := re.fullmatch(rf"global (\w+) = p\[({_NUMBER}(?:, {_NUMBER}){{5}})\]", line):
            numbers = [float(part) for part in match[2].split(", ")]
            read.raw.append(tuple(numbers))
            values[match[1]] = pose(Rotation.from_rotvec(numbers[3:]), 1000 * np.array(numbers[:3]))
        elif match := re.fullmatch(r'global boltpose_scan_id = "(\w+)"', line):
            read.scan_id = match[1]
        elif match := re.fullmatch(r"global boltpose_count = (\d+)", line):
            read.count = int(match[1])
        elif match := re.fullmatch(r"def boltpose_(\w+)\(i\):", line):
            functions[match[1]] = _read_urscript_choice(lines)
        else:
            raise AssertionError(f"no URScript: {line!r}")
    for point in POINTS:
        assert sorted(functions[point]) == list(range(1, read.count + 1))
        read.poses[point] = [values[functions[point][i + 1]] for i in range(read.count)]
    return read


def _read_urscript_choice(lines) -> dict[int, str]:
    branches: dict[int, str] = {}
    for line in lines:
        if match := re.fullmatch(r"  (if|elif) i == (\d+):", line):
            assert (match[1] == "if") == (not branches)
            returned = re.fullmatch(r"    return (\w+)", next(lines))
            branches[int(match[2])] = returned[1]
        else:
            assert line == "  end"
            break
    assert next(lines).startswith("  popup(")
    assert next(lines) == "  halt"  # asked for a bolt that is not there: stop
    assert next(lines) == "end"
    return branches


def read_kuka(content: bytes) -> ReadFile:
    read = ReadFile()
    text = content.decode("ascii")
    assert text.endswith("\r\n")
    lines = text.split("\r\n")
    assert re.fullmatch(r"&ACCESS RVP", lines[0])
    assert re.fullmatch(r"&REL 1", lines[1])
    name = re.fullmatch(r"DEFDAT ([A-Z][A-Z0-9_]*) PUBLIC", lines[2])[1]
    assert len(name) <= 24
    assert [line for line in lines if line][-1] == "ENDDAT"
    sizes: dict[str, int] = {}
    for line in lines[3:-2]:
        if not line:
            continue
        if line.startswith(";"):
            read.comments.append(line[1:].strip())
            assert not re.match(r";\s*(END)?FOLD\b", line)
        elif match := re.fullmatch(r"DECL GLOBAL INT BP_COUNT=(\d+)", line):
            read.count = int(match[1])
        elif match := re.fullmatch(r"DECL GLOBAL CHAR BP_SCAN_ID\[(\d+)\]", line):
            sizes["BP_SCAN_ID"] = int(match[1])
        elif match := re.fullmatch(r'BP_SCAN_ID\[\]="(\w+)"', line):
            assert len(match[1]) == sizes["BP_SCAN_ID"]
            read.scan_id = match[1]
        elif match := re.fullmatch(r"DECL GLOBAL E6POS (\w+)\[(\d+)\]", line):
            assert len(match[1]) <= 24
            sizes[match[1]] = int(match[2])
        elif match := re.fullmatch(r"BP_(\w+)\[(\d+)\]=\{(.*)\}", line):
            parts = dict(part.split(" ") for part in match[3].split(","))
            assert list(parts) == ["X", "Y", "Z", "A", "B", "C"]
            numbers = [float(value) for value in parts.values()]
            read.raw.append(tuple(numbers))
            found = read.poses[match[1].lower()]
            found.append(pose(Rotation.from_euler("ZYX", numbers[3:], degrees=True), numbers[:3]))
            assert int(match[2]) == len(found) <= sizes[f"BP_{match[1]}"]
        else:
            raise AssertionError(f"no KRL: {line!r}")
    return read


def read_fanuc(content: bytes) -> ReadFile:
    read = ReadFile()
    lines = content.decode("ascii").split("\r\n")
    name = re.fullmatch(r"/PROG  ([A-Z][A-Z0-9_]{0,35})", lines[0])[1]
    assert name
    assert lines[1] == "/ATTR"
    main, positions = lines.index("/MN"), lines.index("/POS")
    for line in lines[2:main]:
        if match := re.fullmatch(r'COMMENT\t\t= "BP (\w+)";', line):
            assert len(match[1]) + 3 <= 16
            read.scan_id = match[1]
    for number, line in enumerate(lines[main + 1 : positions], start=1):
        match = re.fullmatch(r" *(\d+):  ([^;]*) ;", line)
        assert match, line
        assert int(match[1]) == number
        step = match[2]
        if step.startswith("!"):
            assert len(step) - 1 <= 32, step
            read.comments.append(step[1:].strip())
        elif copied := re.fullmatch(r"PR\[(\d+)\]=P\[(\d+)\]", step):
            read.raw.append((int(copied[1]), int(copied[2])))
        elif counted := re.fullmatch(r"R\[(\d+)\]=(\d+)", step):
            read.count = int(counted[2])
        else:
            raise AssertionError(f"no TP instruction: {step!r}")
    rest = "\n".join(lines[positions + 1 :])
    value = r" +(-?\d+\.\d{3}) "
    block = re.compile(
        r'P\[(\d+):"([A-Za-z0-9 _.\-]{1,16})"\]\{\n   GP1:\n'
        r"\tUF : (\d+), UT : (\d+),\t\tCONFIG : '([^']+)',\n"
        rf"\tX ={value} mm,\tY ={value} mm,\tZ ={value} mm,\n"
        rf"\tW ={value}deg,\tP ={value}deg,\tR ={value}deg\n\}};\n"
    )
    place = 0
    while match := block.match(rest, place):
        numbers = [float(match[k]) for k in range(6, 12)]
        index = int(match[1]) - 1
        point = POINTS[index % 3]
        assert match[2][0] == "ACR"[index % 3]
        assert len(read.poses[point]) == index // 3
        # turns about the fixed axes x, y, z in this order
        rotation = Rotation.from_euler("xyz", numbers[3:], degrees=True)
        read.poses[point].append(pose(rotation, numbers[:3]))
        place = match.end()
    assert rest[place:] == "/END\n"
    return read


def read_abb(content: bytes) -> ReadFile:
    read = ReadFile()
    lines = content.decode("ascii").split("\r\n")
    # a comment runs from ! to the end of the line, and may not stand within a declaration
    statements = []
    for line in lines:
        if line.strip().startswith("!"):
            assert not statements or statements[-1].rstrip().endswith((";", "MODULE", "HEAD"))
            read.comments.append(line.strip()[1:].strip())
        elif line.strip():
            assert "!" not in line
            statements.append(f"{line} HEAD" if line.startswith("MODULE") else line)
    text = "\n".join(statements).replace(" HEAD", " ")
    head, text = text.split("\n", 1)
    name = re.fullmatch(r"MODULE ([A-Za-z][A-Za-z0-9_]*) ", head)[1]
    assert len(name) <= 32
    assert text.rstrip().endswith("ENDMODULE")
    body = text.rstrip()[: -len("ENDMODULE")]
    for statement in (part.strip() for part in body.split(";")):
        if not statement:
            continue
        if match := re.fullmatch(r'CONST string bpScanId:="([^"]{1,80})"', statement):
            read.scan_id = match[1]
        elif match := re.fullmatch(r"CONST num bpCount:=(\d+)", statement):
            read.count = int(match[1])
        else:
            match = re.fullmatch(r"CONST robtarget bp(\w+)\{(\d+)\}:=(.*)", statement, re.DOTALL)
            assert match, statement
            rows = _read_rapid_list(match[3])
            assert len(rows) == int(match[2])
            for position, quaternion, configuration, external in rows:
                assert len(position) == 3
                assert configuration == [0, 0, 0, 0]
                assert external == [9e9] * 6
                # the controller refuses a quaternion that is not of length 1
                assert abs(np.linalg.norm(quaternion) - 1) < 1e-6
                read.raw.append((*position, *quaternion))
                rotation = Rotation.from_quat(quaternion, scalar_first=True)
                read.poses[match[1].lower()].append(pose(rotation, position))
    return read


def _read_rapid_list(text: str):
    tokens = re.findall(r"[\[\],]|-?\d+(?:\.\d+)?(?:E\d+)?", text)
    assert "".join(tokens) == re.sub(r"\s", "", text)

    def value():
        token = tokens.pop(0)
        if token != "[":
            return float(token)
        found = [value()]
        while (mark := tokens.pop(0)) == ",":
            found.append(value())
        assert mark == "]"
        return found

    result = value()
    assert not tokens
    return result


def read_table(content: bytes) -> ReadFile:
    read = ReadFile()
    rows = list(csv.DictReader(io.StringIO(content.decode("utf-8"), newline="")))
    read.count = len(rows)
    for row in rows:
        for point in POINTS:
            xyz = [float(row[f"{point}_{axis}_mm"]) for axis in "xyz"]
            wxyz = [float(row[f"{point}_q{axis}"]) for axis in "wxyz"]
            read.poses[point].append(pose(Rotation.from_quat(wxyz, scalar_first=True), xyz))
    return read


READERS = {
    "urscript": read_urscript,
    "kuka": read_kuka,
    "fanuc": read_fanuc,
    "abb": read_abb,
    "csv": read_table,
}
