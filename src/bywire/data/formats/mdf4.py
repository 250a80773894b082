"""ASAM MDF 4: groups of channels with common times, read and written by asammdf."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import FileError, quoted
from bywire.core.typing import Progress
from bywire.data.file_format import Column, FileFormat, ReadOptions, library

if TYPE_CHECKING:
    import xarray as xr

_NUMBERS = range(6)  # data types: integers and reals, in both byte orders
_VALUE, _MASTER, _VIRTUAL_MASTER, _VIRTUAL = 0, 2, 3, 6
_TEXTS = range(7, 12)  # conversions to and from texts
_FORMULA = 3  # conversion
_CODES, _RANGES = 7, 8  # conversions with texts for single numbers, and for ranges
_NO_QUANTITY = ("", "-", "1", "enum", "state", "bool")  # units of states
_NO_STATE = frozenset({"sna", "snv", "na", "n/a", "not available", "signal not available"})
_TIME = 1  # kinds of master channels
# asammdf maps a file into memory if it receives the path. This is fast, but large files do not fit.
_MAPPED = 2**29  # bytes
_RECORDS = 1 << 20  # records per piece of a larger file
_WHAT = "MDF files"


class Mdf4Source:
    """An open MDF file; a name in several groups gets the number of its group."""

    def __init__(self, path: Path, file: Any, records: int | None) -> None:
        self._path, self._file, self._records = path, file, records
        self._places: dict[str, tuple[int, int]] = {}
        self._missing: dict[str, Counter[str]] = {}
        self.left_out: dict[str, str] = {}
        self.remarks: list[str] = []
        self.columns: Mapping[str, Column] = self._columns()

    def pieces(self, names: Sequence[str]) -> Iterator[tuple[str, int, NDArray[Any]]]:
        """Yield the numbers of some channels; invalid samples become NaN."""
        for group in sorted({self._places[name][0] for name in names}):
            wanted = [name for name in names if self._places[name][0] == group]
            length = self._file.groups[group].channel_group.cycles_nr
            step = self._records or length
            for begin in range(0, length, step):
                for name, numbers in self._read(group, wanted, begin, min(step, length - begin)):
                    yield name, begin, numbers
        for name, texts in self._missing.items():
            codes = ", ".join(f"{n} x {quoted(text)}" for text, n in texts.most_common(3))
            self.remarks.append(f"{name}: missing samples: {texts.total()} ({codes})")
        self._missing = {}

    def _columns(self) -> dict[str, Column]:
        groups = self._file.groups
        uses = Counter(channel.name for group in groups for channel in group.channels)
        columns: dict[str, Column] = {}
        for g, group in enumerate(groups):
            length = group.channel_group.cycles_nr
            master = self._file.masters_db.get(g)
            every = {
                c: channel.name if uses[channel.name] == 1 else f"{channel.name}@{g}"
                for c, channel in enumerate(group.channels)
            }
            reasons = {c: _why_not(group.channels[c], group.channel_dependencies[c]) for c in every}
            names = {c: name for c, name in every.items() if not reasons[c]}
            of_group = (
                "its group contains no records"
                if not length
                else "its group has no time channel"
                if master not in names
                else "its group's master channel is not time"
                if not _is_time(group.channels[master])
                else ""
            )
            self.left_out |= {
                name: of_group or reasons[c] for c, name in every.items() if of_group or reasons[c]
            }
            if of_group:
                continue
            for c, name in names.items():
                channel = group.channels[c]
                unit = (
                    "s" if c == master else channel.unit or getattr(channel.conversion, "unit", "")
                )
                if not unit and _has_texts(channel) and not _is_quantity(channel):
                    unit = "1"
                clock = None if c == master else names[master]
                self._places[name] = (g, c)
                columns[name] = Column(name, (unit or "").strip(), length, clock, "")
        return columns

    def _read(
        self, group: int, names: Sequence[str], begin: int, size: int
    ) -> Iterator[tuple[str, NDArray[Any]]]:
        """Yield numbers of one group's channels, or of their times, from a record on."""
        master = self._file.masters_db[group]
        indices = [self._places[name][1] for name in names]
        for index in {master, *indices}:
            self._require_inside(group, index)
        # Reading a channel also returns its times. Alone, they are read like any other channel.
        values = [index for index in indices if index != master]
        signals: dict[int, Any] = {}
        for coded in (False, True):
            wanted = [i for i in values if _has_codes(self._channel(group, i)) == coded]
            if wanted or (not values and not coded):
                signals |= self._selected(group, wanted or [master], begin, size, raw=coded)
        instants = next(iter(signals.values())).timestamps
        for name, index in zip(names, indices, strict=True):
            signal = None if index == master else signals[index]
            numbers = instants if signal is None else signal.samples
            if numbers.ndim != 1 or numbers.dtype.kind not in "iufb":
                raise FileError(
                    f"{self._path}: channel {name!r} does not contain numbers. Do not select it",
                    name=name,
                )
            channel = self._channel(group, index)
            if signal is not None and _has_codes(channel):
                numbers = self._without_codes(name, channel, numbers)
            if signal is not None and signal.invalidation_bits is not None:
                numbers = numbers.astype(np.float64)
                invalid = np.asarray(signal.invalidation_bits, dtype=bool)
                numbers[invalid] = np.nan
                self._count(name, "marked as invalid", invalid)
            yield name, numbers

    def _channel(self, group: int, index: int) -> Any:
        return self._file.groups[group].channels[index]

    def _selected(
        self, group: int, indices: Sequence[int], begin: int, size: int, *, raw: bool
    ) -> dict[int, Any]:
        """Return some records of channels, raw or converted."""
        self._records_read = 0
        # The library is a third slower if the number of records is limited.
        signals = self._file.select(
            [(None, group, index) for index in indices],
            record_offset=begin,
            record_count=None if self._records is None else size,
            raw=raw,
            copy_master=False,
            ignore_value2text_conversions=True,
            validate=False,
        )
        if self._records_read != size:
            raise FileError(
                f"{self._path} is damaged: group {group} declares {size} records from {begin} on, "
                f"but only {self._records_read} could be read. Copy it again, or repair it with "
                "the program that recorded it",
                name=str(self._path),
            )
        return dict(zip(indices, signals, strict=True))

    def _without_codes(self, name: str, channel: Any, raw: NDArray[Any]) -> NDArray[np.float64]:
        """Return numbers with NaN where the file has a text, unless the texts are states."""
        texts: dict[str, NDArray[np.bool_]] = {}
        numbers = _converted(channel.conversion, raw, texts)
        is_quantity = _is_quantity(channel)
        for text, where in texts.items():
            if is_quantity or text.casefold() in _NO_STATE:
                numbers[where] = np.nan
                self._count(name, text, where)
        return numbers

    def _count(self, name: str, why: str, where: NDArray[np.bool_]) -> None:
        if count := int(np.count_nonzero(where)):
            self._missing.setdefault(name, Counter())[why] += count

    def _require_inside(self, group: int, index: int) -> None:
        """Reject a channel beyond the end of its record, since it would contain other data."""
        place = self._file.groups[group]
        channel, size = place.channels[index], place.channel_group.samples_byte_nr
        end = channel.byte_offset + (channel.bit_offset + channel.bit_count + 7) // 8
        if channel.channel_type not in (_VIRTUAL_MASTER, _VIRTUAL) and end > size:
            raise FileError(
                f"{self._path} is damaged: the channel {quoted(channel.name)} extends to byte "
                f"{end}, but records have {size} bytes. Copy it again, or repair it with the "
                "program that recorded it",
                name=channel.name,
            )

    def count_records(self) -> None:
        """Count the records that were read, since the library does not report missing ones.

        The library stops at a truncated or corrupt block, and leaves arbitrary numbers.
        """
        inner = self._file._mdf
        plain = inner._yield_selected_signals

        def counted(*args: Any, **kwargs: Any) -> Iterator[Any]:
            for k, signals in enumerate(plain(*args, **kwargs)):
                self._records_read += len(signals[0].samples if k == 0 else signals[0][0])
                yield signals

        inner._yield_selected_signals = counted


def _is_time(master: Any) -> bool:
    return bool(master.sync_type == _TIME)


def _why_not(channel: Any, parts: Any) -> str:
    """Return the reason to skip a channel; empty if it contains numbers."""
    if parts:
        return "it is an array or a structure"
    if channel.data_type not in _NUMBERS:
        return "it contains text or bytes"
    if channel.channel_type not in (_VALUE, _MASTER, _VIRTUAL_MASTER, _VIRTUAL):
        return "it contains no samples itself"
    if _has_formula(channel.conversion):
        return "a formula converts it, and bywire does not evaluate formulas in files"
    return ""


def _has_formula(conversion: Any) -> bool:
    """Return whether a conversion, or one within it, uses a formula."""
    if getattr(conversion, "conversion_type", None) == _FORMULA:
        return True
    inner = getattr(conversion, "referenced_blocks", None) or {}
    return any(_has_formula(block) for block in inner.values())


def _has_texts(channel: Any) -> bool:
    """Return whether a channel's numbers represent texts; bywire reads the numbers."""
    return getattr(channel.conversion, "conversion_type", 0) in _TEXTS


def _has_codes(channel: Any) -> bool:
    return getattr(channel.conversion, "conversion_type", 0) in (_CODES, _RANGES)


def _is_quantity(channel: Any) -> bool:
    """Return whether a channel whose conversion has texts also contains measured values.

    It does if the conversion has a factor for the other numbers, or a unit and no default text.
    """
    inner = _blocks(channel.conversion)
    if any(not isinstance(block, bytes) and _is_numeric(block) for block in inner):
        return True
    unit = (channel.unit or getattr(channel.conversion, "unit", "") or "").strip()
    default = (getattr(channel.conversion, "referenced_blocks", None) or {}).get("default_addr")
    return unit.casefold() not in _NO_QUANTITY and not default


def _is_numeric(conversion: Any) -> bool:
    if getattr(conversion, "conversion_type", 0) in (_CODES, _RANGES):
        return any(not isinstance(b, bytes) and _is_numeric(b) for b in _blocks(conversion))
    return getattr(conversion, "conversion_type", 0) not in _TEXTS


def _blocks(conversion: Any) -> list[Any]:
    blocks = getattr(conversion, "referenced_blocks", None) or {}
    return [block for block in blocks.values() if block is not None]


def _converted(
    conversion: Any, raw: NDArray[Any], texts: dict[str, NDArray[np.bool_]]
) -> NDArray[np.float64]:
    """Return converted numbers, and for each text the samples that it represents."""
    kind = getattr(conversion, "conversion_type", None)
    if kind not in (_CODES, _RANGES):
        plain = conversion.convert(raw, ignore_value2text_conversions=True) if conversion else raw
        return np.array(plain, dtype=np.float64)
    numbers = raw.astype(np.float64)
    rest = np.ones(raw.shape, dtype=bool)
    for k, where in enumerate(_entries(conversion, kind, raw)):
        where = where & rest
        rest &= ~where
        _fill(conversion.referenced_blocks.get(f"text_{k}"), where, raw, numbers, texts)
    _fill(conversion.referenced_blocks.get("default_addr"), rest, raw, numbers, texts)
    return numbers


def _entries(conversion: Any, kind: int, raw: NDArray[Any]) -> Iterator[NDArray[np.bool_]]:
    """Yield a mask of the raw numbers that belong to each entry of a conversion."""
    if kind == _CODES:
        for k in range(conversion.val_param_nr):
            yield raw == conversion[f"val_{k}"]
    else:
        for k in range(conversion.val_param_nr // 2):
            low, high = conversion[f"lower_{k}"], conversion[f"upper_{k}"]
            below = raw < high if raw.dtype.kind == "f" and low != high else raw <= high
            yield (raw >= low) & below


def _fill(
    block: Any,
    where: NDArray[np.bool_],
    raw: NDArray[Any],
    numbers: NDArray[np.float64],
    texts: dict[str, NDArray[np.bool_]],
) -> None:
    """Convert the numbers of one entry, or record the samples of its text."""
    if not block or not where.any():
        return
    if isinstance(block, bytes):
        text = block.decode("utf-8", "replace").strip("\0 ")
        texts[text] = texts.get(text, np.zeros(raw.shape, dtype=bool)) | where
        return
    inner: dict[str, NDArray[np.bool_]] = {}
    numbers[where] = _converted(block, raw[where], inner)
    for text, inside in inner.items():
        marked = np.zeros(raw.shape, dtype=bool)
        marked[np.flatnonzero(where)[inside]] = True
        texts[text] = texts.get(text, np.zeros(raw.shape, dtype=bool)) | marked


@contextmanager
def _open(path: Path, options: ReadOptions) -> Iterator[Mdf4Source]:
    import asammdf

    _require_mdf4(path)
    is_small = path.stat().st_size <= _MAPPED
    with path.open("rb") as stream, asammdf.MDF(path if is_small else stream) as file:
        source = Mdf4Source(path, file, None if is_small else _RECORDS)
        source.count_records()
        yield source


def _require_mdf4(path: Path) -> None:
    with path.open("rb") as stream:
        head = stream.read(16)
    if head[:8] != b"MDF     ":
        raise FileError(
            f"{path} is incomplete: the recorder stopped before it wrote the number of records. "
            "Finalize it with the program that recorded it",
            name=str(path),
        )
    if head[8:9] != b"4":
        version = head[8:16].decode("latin-1").strip("\0 ")
        raise FileError(
            f"{path} is MDF {version}. Convert it to MDF 4, for example with asammdf",
            name=str(path),
            value=str(version),
            valid="MDF 4",
        )


def _write(dataset: xr.Dataset, path: Path, progress: Progress) -> None:
    asammdf = library("asammdf", _WHAT)
    with asammdf.MDF(version="4.10") as file:
        for dim in dict.fromkeys(str(signal.dims[0]) for signal in dataset.data_vars.values()):
            time = np.asarray(dataset[dim].values, dtype=np.float64)
            signals = [
                asammdf.Signal(
                    samples=np.asarray(signal.values),
                    timestamps=time,
                    name=str(name),
                    unit=str(signal.attrs.get("units", "1")),
                )
                for name, signal in dataset.data_vars.items()
                if signal.dims[0] == dim
            ]
            file.append(signals, comment="bywire")
        progress(f"writing {path.name}", 0.5)
        file.save(path, overwrite=True, compression=0)
    progress(f"writing {path.name}", 1.0)


FORMAT = FileFormat(
    "mdf4",
    "an MDF file",
    (".mf4", ".mdf", ".dat"),
    lambda head: head[:3] == b"MDF" or head[:7] == b"UnFinMF",
    _open,
    _write,
    has_many_axes=True,
    libraries=("asammdf",),
    counts=("record", 0),
    opening=60.0,  # asammdf reads the description of every channel, possibly thousands
)
