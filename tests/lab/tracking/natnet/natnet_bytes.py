"""NatNet messages by hand: hexadecimal, field by field."""


def message(kind, *fields):
    content = bytes.fromhex("".join(fields))
    return kind.to_bytes(2, "little") + len(content).to_bytes(2, "little") + content


NUMBER = "07 00 00 00"
NONE = "00 00 00 00"
ONE = "01 00 00 00"
TWO = "02 00 00 00"
POINT = "00 00 80 3f" + "00 00 00 40" + "00 00 40 40"  # 1, 2, 3
IDENTITY = "00 00 00 00" * 3 + "00 00 80 3f"
ERROR = "00 00 00 00"
TRACKED = "01 00"
LOST = "00 00"
MARKER_SET = "62 00" + TWO + POINT + POINT  # "b", two markers
BODY = "05 00 00 00" + POINT + IDENTITY + ERROR + TRACKED  # id 5
LOST_BODY = "06 00 00 00" + POINT + "00" * 16 + ERROR + LOST  # id 6, no rotation
SKELETON = "01 00 00 00" + ONE + BODY
ASSET_MARKER = NUMBER + POINT + ERROR + LOST + ERROR
ASSET = "09 00 00 00" + ONE + BODY + ONE + ASSET_MARKER
LABELED = NUMBER + POINT + ERROR + LOST + ERROR
PLATE = "02 00 00 00" + ONE + TWO + "00 00 80 3f" * 2  # a channel of two samples
TIME = "00 00 00 00 00 00 f8 3f"  # 1.5
CODES = "00" * 8
TICKS = "00" * 24
PRECISE = "01 00 00 00 00 00 00 80"
END = "00 00 00 00"

SECTIONS_3 = (
    *(ONE, MARKER_SET),
    *(TWO, POINT, POINT),
    *(TWO, BODY, LOST_BODY),
    *(ONE, SKELETON),
    *(ONE, LABELED),
    *(ONE, PLATE),
    *(NONE,),
)
SUFFIX_3 = (CODES, TIME, TICKS, "00 00", END)
SUFFIX_4 = (CODES, TIME, TICKS, PRECISE, "02 00", END)  # models changed


def sized(count, content):
    size = len(bytes.fromhex(content)).to_bytes(4, "little").hex()
    return count + size + content


SECTIONS_41 = (
    sized(ONE, MARKER_SET),
    sized(TWO, POINT + POINT),
    sized(TWO, BODY + LOST_BODY),
    sized(ONE, SKELETON),
    sized(ONE, ASSET),
    sized(ONE, LABELED),
    sized(ONE, PLATE),
    sized(NONE, ""),
)
FRAMES = {
    (3, 1): message(7, NUMBER, *SECTIONS_3, *SUFFIX_3),
    (4, 0): message(7, NUMBER, *SECTIONS_3, *SUFFIX_3),
    (4, 1): message(7, NUMBER, *SECTIONS_41, *SUFFIX_4),
    (4, 2): message(7, NUMBER, *SECTIONS_41, *SUFFIX_4),
}

NAME = "62 61 73 65 00"  # "base"
LABEL = NONE
SET_DEFINITION = "61 00" + ONE + "6d 00"  # "a", marker "m"
BODY_DEFINITION_3 = NAME + "05 00 00 00" + "ff ff ff ff" + POINT + ONE + POINT + LABEL
BODY_DEFINITION_4 = BODY_DEFINITION_3 + "6d 00"
# a rotation follows the offset
BODY_DEFINITION_42 = BODY_DEFINITION_4.replace(POINT, POINT + IDENTITY, 1)
CAMERA = "63 00" + POINT + IDENTITY
PLATE_DEFINITION = (
    NUMBER + "73 00" + POINT[:22] + POINT + "00" * 576 + "00" * 48 + NONE * 2
) + (ONE + "46 00")
TYPES = {
    name: number.to_bytes(4, "little").hex()
    for number, name in enumerate(("set", "body", "skeleton", "plate"))
} | {"camera": "05 00 00 00", "new": "63 00 00 00"}


def definitions_3(body):
    return message(
        5,
        "04 00 00 00",
        *(TYPES["set"], SET_DEFINITION),
        *(TYPES["plate"], PLATE_DEFINITION),
        *(TYPES["camera"], CAMERA),
        *(TYPES["body"], body),
    )


def definitions_41(body):
    return message(
        5,
        "03 00 00 00",
        sized(TYPES["new"], "ff ff ff"),
        sized(TYPES["set"], SET_DEFINITION),
        sized(TYPES["body"], body),
    )


DEFINITIONS = {
    (3, 1): definitions_3(BODY_DEFINITION_3),
    (4, 0): definitions_3(BODY_DEFINITION_4),
    (4, 1): definitions_41(BODY_DEFINITION_4),
    (4, 2): definitions_41(BODY_DEFINITION_42),
}
SERVER_INFO = message(
    1,
    "4d 6f 74 69 76 65" + "00" * 250,
    "03 01 00 00",
    "04 01 00 00",
    "80 96 98 00 00 00 00 00",  # 10 MHz
    "e7 05",  # 1511
    "01",
    "ef ff 2a 63",  # 239.255.42.99
)
