"""Damage done to files: to any bytes, and to what OpenEXR's and Radiance's headers promise.

The same random numbers do the same damage.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Iterator, Sequence
from random import Random
from typing import NamedTuple

EXR = b"\x76\x2f\x31\x01"

INTEGERS = (0, 1, 2, 3, 7, 8, 255, 256, 65_535, 2**16, 2**24, 2**30, 2**31 - 2, 2**31 - 1, 2**31)
"""Numbers at which programs go wrong; their negatives and 2^32 - 1 too."""

SIGNED = tuple(n for n in INTEGERS if n < 2**31) + tuple(-n for n in INTEGERS)

OFFSETS = (0, 1, 8, 2**31, 2**32, 2**40, 2**63 - 1, 2**63, 2**64 - 8, 2**64 - 1)

Mutation = Callable[[bytearray, Random, Sequence[bytes]], bytes | bytearray]


class Attribute(NamedTuple):
    """An attribute of an OpenEXR header: offsets of its name, its size and its value."""

    name: bytes
    kind: bytes
    start: int
    size_at: int
    value_at: int
    size: int


def mutated(corpus: Sequence[bytes], seed: int, number: int) -> bytes:
    """The file of this number: one of the corpus with one to four damages, always the same."""
    random = Random(f"{seed}/{number}")
    content: bytes | bytearray = random.choice(corpus)
    for _ in range(random.choice((1, 1, 1, 2, 2, 3, 4))):
        content = _mutation_for(content, random)(bytearray(content), random, corpus)
    return bytes(content)


def _mutation_for(content: bytes | bytearray, random: Random) -> Mutation:
    if random.random() < 0.6:
        if content[:4] == EXR:
            return random.choice(OF_EXR)
        if content[:2] == b"#?":
            return random.choice(OF_RADIANCE)
    return random.choice(OF_ANY)


def flip_bits(content: bytearray, random: Random, corpus: Sequence[bytes]) -> bytearray:
    for _ in range(random.choice((1, 1, 2, 4, 16))):
        if content:
            content[random.randrange(len(content))] ^= 1 << random.randrange(8)
    return content


def change_head(content: bytearray, random: Random, corpus: Sequence[bytes]) -> bytearray:
    """Bytes near the beginning, where headers are."""
    for _ in range(random.choice((1, 2, 3, 8))):
        if len(content) > 4:
            content[random.randrange(4, min(len(content), 500))] = random.choice(
                (0, 1, 127, 128, 255, random.randrange(256))
            )
    return content


def write_number(content: bytearray, random: Random, corpus: Sequence[bytes]) -> bytearray:
    """A telling number of 1 to 8 bytes in either order, anywhere."""
    value, size = random.choice(INTEGERS + OFFSETS), random.choice((1, 2, 4, 8))
    order = random.choice(("little", "big"))
    place = random.randrange(max(len(content), 1))
    content[place : place + size] = (value % 256**size).to_bytes(size, order)
    return content


def truncate(content: bytearray, random: Random, corpus: Sequence[bytes]) -> bytearray:
    return content[: random.randrange(len(content) + 1)]


def append(content: bytearray, random: Random, corpus: Sequence[bytes]) -> bytearray:
    return content + random.randbytes(random.choice((1, 8, 1000)))


def _block(content: bytearray, random: Random) -> slice:
    start = random.randrange(len(content) + 1)
    return slice(start, start + random.choice((1, 4, 8, 16, 64, 1024)))


def duplicate(content: bytearray, random: Random, corpus: Sequence[bytes]) -> bytearray:
    part, place = content[_block(content, random)], random.randrange(len(content) + 1)
    return content[:place] + part * random.choice((1, 1, 2, 100)) + content[place:]


def remove(content: bytearray, random: Random, corpus: Sequence[bytes]) -> bytearray:
    del content[_block(content, random)]
    return content


def blank(content: bytearray, random: Random, corpus: Sequence[bytes]) -> bytearray:
    part = _block(content, random)
    content[part] = random.choice((b"\0", b"\xff", b"\1")) * len(content[part])
    return content


def exchange(content: bytearray, random: Random, corpus: Sequence[bytes]) -> bytearray:
    """A piece of one place at another."""
    part, place = content[_block(content, random)], random.randrange(len(content) + 1)
    content[place : place + len(part)] = part
    return content


def splice(content: bytearray, random: Random, corpus: Sequence[bytes]) -> bytearray:
    """The beginning of this file and the end of another, of the same kind where there is one."""
    alike = [other for other in corpus if other[:2] == content[:2]]
    other = random.choice(alike or corpus)
    place = random.randrange(len(content) + 1)
    return content[:place] + other[min(place, random.randrange(len(other) + 1)) :]


def attributes(content: bytes | bytearray) -> Iterator[Attribute]:
    """Of all headers of an OpenEXR file, as far as they can be followed."""
    place = 8
    while place < len(content):
        start, name_end = place, content.find(b"\0", place)
        if name_end <= start:  # the end of a header; another may follow
            place = start + 1
            if name_end < 0 or content[place : place + 1] in (b"", b"\0"):
                return
            continue
        kind_end = content.find(b"\0", name_end + 1)
        value_at = kind_end + 5
        if kind_end < 0 or name_end - start > 255 or value_at > len(content):
            return
        (size,) = struct.unpack_from("<i", content, kind_end + 1)
        if not 0 <= size <= len(content) - value_at:
            return
        name, kind = bytes(content[start:name_end]), bytes(content[name_end + 1 : kind_end])
        yield Attribute(name, kind, start, kind_end + 1, value_at, size)
        place = value_at + size


def change_attribute(content: bytearray, random: Random, corpus: Sequence[bytes]) -> bytearray:
    """A value that another program would not believe."""
    found = list(attributes(content))
    if not found:
        return change_head(content, random, corpus)
    chosen = random.choice(found)
    value = bytearray(content[chosen.value_at : chosen.value_at + chosen.size])
    content[chosen.value_at : chosen.value_at + chosen.size] = _other_value(value, chosen, random)
    return content


def _other_value(value: bytearray, chosen: Attribute, random: Random) -> bytearray:
    """Of the same length: one number in it, one byte, or for channels one of their fields."""
    if not value:
        return value
    if chosen.kind == b"chlist" and random.random() < 0.7:
        return _other_channel(value, random)
    if len(value) >= 4 and random.random() < 0.7:
        place = 4 * random.randrange(len(value) // 4)
        number = random.choice((*SIGNED, 15, 16, 31, 32, 64))
        value[place : place + 4] = struct.pack("<I", number % 2**32)
        return value
    value[random.randrange(len(value))] = random.choice((*range(16), 128, 255))
    return value


def _other_channel(value: bytearray, random: Random) -> bytearray:
    """Another pixel type or sampling of one channel: name, 0, type, linear, x and y sampling."""
    ends, place = [], 0
    while place < len(value) and value[place]:
        place = value.find(b"\0", place) + 1
        if place == 0 or place + 16 > len(value):
            break
        ends.append(place)
        place += 16
    if ends:
        field = random.choice(ends) + random.choice((0, 8, 12))
        value[field : field + 4] = struct.pack("<I", random.choice(SIGNED) % 2**32)
    return value


def change_windows(content: bytearray, random: Random, corpus: Sequence[bytes]) -> bytearray:
    """Data window, display window or both promise another size, often still 2:1."""
    left, top = random.choice(((0, 0), (0, 0), (-5, 3), (2**30, 0), (-(2**31), -(2**31))))
    height = random.choice((1, 4, 15, 17, 64, 1024, 8192, 16_384, 32_768, 2**20, 2**30))
    width = random.choice((2 * height, 2 * height, height, 1, 2**31 - 1))
    frame = (left, top, left + width - 1, top + height - 1)
    box = b"".join(((n + 2**31) % 2**32 - 2**31).to_bytes(4, "little", signed=True) for n in frame)
    names = random.choice(
        ((b"dataWindow",), (b"displayWindow",), (b"dataWindow", b"displayWindow"))
    )
    for found in list(attributes(content)):
        if found.name in names and found.size == 16:
            content[found.value_at : found.value_at + 16] = box
    return content


def change_structure(content: bytearray, random: Random, corpus: Sequence[bytes]) -> bytearray:
    """An attribute's size, or the attribute itself: gone, twice, or under another name."""
    found = list(attributes(content))
    if not found:
        return change_head(content, random, corpus)
    chosen = random.choice(found)
    whole = content[chosen.start : chosen.value_at + chosen.size]
    end = chosen.value_at + chosen.size
    match random.randrange(5):
        case 0:
            size = struct.pack("<I", random.choice((*SIGNED, chosen.size + 1)) % 2**32)
            content[chosen.size_at : chosen.size_at + 4] = size
        case 1:
            del content[chosen.start : end]
        case 2:
            content[end:end] = whole * random.choice((1, 1, 50))
        case 3:
            other = random.choice(found)
            content[end:end] = other.name + b"\0" + other.kind + whole[chosen.size_at - 1 :]
        case _:
            name = random.choice((b"", b"..", "ü空".encode(), b"\xff\xfe", b"n" * 300))
            content[chosen.start : chosen.start + len(chosen.name)] = name
    return content


def change_version(content: bytearray, random: Random, corpus: Sequence[bytes]) -> bytearray:
    """Tiles, long names, deep data and many parts are bits of the fifth to eighth byte."""
    content[5] ^= random.choice((0x02, 0x04, 0x08, 0x10, 0x18, 0x0A, 0x1A, 0x01))
    return content


def change_chunks(content: bytearray, random: Random, corpus: Sequence[bytes]) -> bytearray:
    """Offsets of blocks, or what stands before the blocks: their row and their size."""
    found = list(attributes(content))
    if not found:
        return truncate(content, random, corpus)
    table = found[-1].value_at + found[-1].size + 1
    place = table + random.choice((8 * random.randrange(6), 4 * random.randrange(40)))
    if random.random() < 0.5:
        value = struct.pack("<Q", random.choice((*OFFSETS, table, len(content), len(content) - 4)))
    else:
        value = struct.pack("<I", random.choice(SIGNED) % 2**32)
    content[place : place + len(value)] = value
    return content


def change_resolution(content: bytearray, random: Random, corpus: Sequence[bytes]) -> bytes:
    """The numbers, signs and axes of a Radiance header."""
    height = random.choice((0, 1, 4, 16, 17, 4096, 16_384, 32_767, 2**20, 2**31, 2**40, 10**30))
    width = random.choice((2 * height, 2 * height, 32, 1, 32_768))
    signs, axes = random.choice(("-+", "+-", "--", "++")), random.choice(("YX", "XY", "YY"))
    line = f"{signs[0]}{axes[0]} {height} {signs[1]}{axes[1]} {width}".encode()
    return re.sub(rb"[-+][XY] \d+ [-+][XY] \d+", line, bytes(content), count=1)


def change_line(content: bytearray, random: Random, corpus: Sequence[bytes]) -> bytearray:
    """A line of a Radiance header more, less, or another."""
    lines = (b"EXPOSURE=0", b"EXPOSURE=" + b"9" * 400, b"FORMAT=32-bit_rle_rgbe", b"FORMAT=", b"")
    odd = (b"PRIMARIES=nan nan", b"x" * 70_000, b"\xff\xfe", b"-Y 9 +X 18", b"GAMMA=-1", b"\r")
    head = content.find(b"\n\n")
    ends = [n for n in range(max(head, 0) + 2) if content[n : n + 1] == b"\n"]
    if ends:
        place = random.choice(ends) + 1
        end = content.find(b"\n", place) + 1 if random.random() < 0.3 else place
        content[place:end] = random.choice(lines + odd) + b"\n"
    return content


def change_runs(content: bytearray, random: Random, corpus: Sequence[bytes]) -> bytearray:
    """Lengths of runs and marks of lines among a Radiance file's pixels."""
    head = content.find(b"\n\n")
    start = content.find(b"\n", head + 2) + 1
    codes = (b"\0", b"\x80", b"\xff", b"\2\2\0\x20", b"\2\2\x7f\xff", b"\1\1\1\xff", b"\1\1\1\0")
    for _ in range(random.choice((1, 1, 4))):
        if len(content) > start:
            place, code = random.randrange(start, len(content)), random.choice(codes)
            content[place : place + len(code)] = code * random.choice((1, 1, 4))
    return content


OF_ANY: tuple[Mutation, ...] = (
    *(flip_bits, flip_bits, change_head, write_number, truncate, append),
    *(duplicate, remove, blank, exchange, splice),
)
OF_EXR: tuple[Mutation, ...] = (
    *(change_attribute, change_attribute, change_attribute, change_windows, change_structure),
    *(change_version, change_chunks, change_chunks),
)
OF_RADIANCE: tuple[Mutation, ...] = (change_resolution, change_line, change_runs)
