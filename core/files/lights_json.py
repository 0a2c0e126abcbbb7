"""`<stem>.lights.json`: suns and account, for people, for other programs and for reading again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

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
        account = Account(*(np.array(document["account"][k]) for k in _ACCOUNT_PARTS))
        if document["residual"]:  # may be null, but must be there
            str(document["residual"]["file"])
    except (KeyError, TypeError, ValueError) as error:
        raise UnusableInput(f"{path.name} is damaged: {error!r} in its suns or account.") from error
    return document, suns, account


def read_document(path: Path, file_format: str = FORMAT, version: int = VERSION) -> dict[str, Any]:
    """A JSON file of ours, of one format and version. Raises UnusableInput."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise UnusableInput(f"{path} does not exist.") from None
    except (OSError, ValueError) as error:
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


_ACCOUNT_PARTS = ("source", "suns", "residual")


def _sun(entry: dict[str, Any]) -> Sun:
    return Sun(
        to_light=np.array(entry["to_light"], dtype=np.float64),
        irradiance=np.array(entry["irradiance"], dtype=np.float64),
        scalar_irradiance=np.array(entry["scalar_irradiance"], dtype=np.float64),
        angular_diameter=float(entry["angular_diameter"]),
        stratum=int(entry["stratum"]),
    )
