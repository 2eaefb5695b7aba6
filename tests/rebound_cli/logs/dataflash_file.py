"""Small ArduPilot logs, written byte by byte as libraries/AP_Logger/README.md of ArduPilot describes them.

Every message is two bytes of head, its type and its fields without gaps. What a type's fields are is told by a message
of type 128, FMT: the type described, its length, a name of four bytes, sixteen letters and sixty-four bytes of names.
"""

import struct

HEAD = b"\xa3\x95"
# A letter of FMT to that of struct, and the factor by which a number is kept.
LETTERS = {"B": ("B", 1), "b": ("b", 1), "H": ("H", 1), "h": ("h", 1), "I": ("I", 1), "Q": ("Q", 1), "f": ("f", 1)}
LETTERS |= {"M": ("B", 1), "c": ("h", 100), "C": ("H", 100), "L": ("i", 10_000_000), "N": ("16s", 1), "Z": ("64s", 1)}
FORMAT = ("BBnNZ", "Type,Length,Name,Format,Columns")


# Copter 4.3: an instance in I, a core in C.
FORMATS = {
    "MSG": ("QZ", "TimeUS,Message"),
    "PARM": ("QNff", "TimeUS,Name,Value,Default"),
    "IMU": ("QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
    "ATT": ("Qccccff", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw"),
    "CTUN": ("Qffhh", "TimeUS,ThO,Alt,DCRt,CRt"),
    "XKF1": ("QBccCffffff", "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,PN,PE,PD"),
    "XKF4": ("QBIb", "TimeUS,C,SS,PI"),
    "EV": ("QB", "TimeUS,Id"),
    "MODE": ("QMBB", "TimeUS,Mode,ModeNum,Rsn"),
    "VIBE": ("QBfffI", "TimeUS,IMU,VibeX,VibeY,VibeZ,Clip"),
    "PSCD": ("Qfff", "TimeUS,TPD,DVD,TVD"),
}


def structure(letters):
    return struct.Struct("<" + "".join(LETTERS[letter][0] for letter in letters))


def described(number, name, letters, columns):
    """A message of FMT."""
    length = 89 if name == "FMT" else 3 + structure(letters).size
    fields = struct.pack("<BB4s16s64s", number, length, name.encode(), letters.encode(), columns.encode())
    return HEAD + bytes([128]) + fields


def packed(number, letters, row):
    values = [
        value.encode() if isinstance(value, str) else round(value * factor) if code not in "fsd" else value
        for value, (code, factor) in zip(row, (LETTERS[letter] for letter in letters), strict=True)
    ]
    return HEAD + bytes([number]) + structure(letters).pack(*values)


def dataflash(rows, formats=FORMATS):
    """Rows: (name, value, ...), as they were written. Formats: name -> (letters, columns)."""
    numbers = {name: 129 + number for number, name in enumerate(formats)}
    parts = [described(128, "FMT", *FORMAT)]
    parts += [described(numbers[name], name, *described_by) for name, described_by in formats.items()]
    parts += [packed(numbers[name], formats[name][0], row) for name, *row in rows]
    return b"".join(parts)


def imu(times_us, force=(0.0, 0.0, -9.81), instance=0):
    return [("IMU", t, instance, 0.1, 0.2, 0.3, *force) for t in times_us]
