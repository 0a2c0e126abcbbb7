"""`<stem>.lights.json`: suns and account, for people, for other programs and for reading again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..account import Account
from ..errors import UnusableInput
from ..suns import Sun
from .atomic import finish_interrupted

FORMAT = "sunsplit.lights"
VERSION = 1
AXES = "right-handed, Z up, image centre +X, u = 0.25 is +Y"


def sun_as_dict(sun: Sun) -> dict[str, Any]:
    return {
        "to_light": sun.to_light.tolist(),
        "irradiance": sun.irradiance.tolist(),
        "scalar_irradiance": sun.scalar_irradiance.tolist(),
        "angular_diameter": sun.angular_diameter,
        "stratum": sun.stratum,
    }


def account_as_dict(account: Account) -> dict[str, Any]:
    return {
        "source": account.source.tolist(),
        "suns": account.suns.tolist(),
        "residual": account.residual.tolist(),
        "relative_error": account.relative_error.tolist(),
    }


def write(path: Path, document: dict[str, Any]) -> None:
    """Write a whole document; see README for its fields."""
    text = json.dumps({"format": FORMAT, "version": VERSION, "axes": AXES, **document}, indent=2)
    path.write_text(text + "\n", encoding="utf-8")


def read(path: Path) -> tuple[dict[str, Any], tuple[Sun, ...], Account]:
    """The whole document, its suns and its account. Raises UnusableInput.

    What a killed process had begun to write there is finished first.
    """
    finish_interrupted(path.parent)
    document = read_document(path)
    try:
        suns = tuple(_sun(entry) for entry in document["suns"])
        account = Account(*(numbers(document["account"][k], 3) for k in _ACCOUNT_PARTS))
        if document["residual"]:  # may be null, but must be there
            named_file(path, document["residual"])
    except DAMAGE as error:
        raise UnusableInput(f"{path.name} is damaged: {error!r} in its suns or account.") from error
    return document, suns, account


def read_document(path: Path, file_format: str = FORMAT, version: int = VERSION) -> dict[str, Any]:
    """A JSON file of ours, of one format and version. Raises UnusableInput."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise UnusableInput(f"{path} does not exist.") from None
    except (OSError, ValueError, RecursionError) as error:
        raise UnusableInput(f"{path.name} is not readable JSON ({error}).") from error
    if not isinstance(document, dict) or document.get("format") != file_format:
        raise UnusableInput(
            f"{path.name} was not written by Sunsplit as {file_format}: its format is missing."
        )
    if document.get("version") != version:
        raise UnusableInput(
            f"{path.name} has version {document.get('version')}; this Sunsplit reads {version}."
        )
    return document


def named_file(document: Path, entry: dict[str, Any]) -> tuple[Path, str | None]:
    """The file that an entry of a document names, and its SHA-256, which older ones do not state.

    It lies beside the document, whatever folders its name may hold. Raises one of `DAMAGE`.
    """
    name, stated = entry["file"], entry.get("sha256")
    if not isinstance(name, str) or "\0" in name or Path(name).name in ("", ".."):
        raise ValueError(f"{name!r} names no file")
    return document.parent / Path(name).name, stated


def numbers(values: object, *shape: int) -> NDArray[np.float64]:
    """Finite numbers of this shape. Raises one of `DAMAGE`."""
    array = np.array(values, dtype=np.float64).reshape(shape)
    if not np.isfinite(array).all():
        raise ValueError("a number that is not finite")
    return array


DAMAGE = (KeyError, TypeError, ValueError, AttributeError, OverflowError)
"""What a document that was changed by others raises where its parts are taken."""

_ACCOUNT_PARTS = ("source", "suns", "residual")


def _sun(entry: dict[str, Any]) -> Sun:
    return Sun(
        to_light=numbers(entry["to_light"], 3),
        irradiance=numbers(entry["irradiance"], 3),
        scalar_irradiance=numbers(entry["scalar_irradiance"], 3),
        angular_diameter=float(numbers(entry["angular_diameter"])),
        stratum=int(entry["stratum"]),
    )
