"""Files that are cut, flipped or made to exhaust the reader: they read, or one error says why."""

import struct
import zlib

import numpy as np
import pytest
from measurement_files import FORMATS, NEEDS, file_of, measurement
from scipy.io import savemat

from bywire.core.errors import FileError, InputError
from bywire.data import limited_source
from bywire.data.file_format import ReadOptions
from bywire.data.format_registry import FORMATS as KNOWN
from bywire.data.measurement import read_measurement

CUTS, FLIPS = 20, 50
HUGE = 10**15


@pytest.fixture(params=list(FORMATS))
def name(request):
    if request.param in NEEDS:
        pytest.importorskip(NEEDS[request.param])
    return request.param


def outcomes(path, contents):
    """Return how often contents of a file were read, and the errors of the others."""
    read, errors = 0, []
    for content in contents:
        path.write_bytes(content)
        try:
            read_measurement(path)
            read += 1
        except InputError as error:
            errors.append(str(error))
    return read, errors


def test_cut_files(tmp_path, name):
    path = file_of(tmp_path, name, measurement(60))
    whole = path.read_bytes()
    read, errors = outcomes(path, [whole[: k * len(whole) // CUTS] for k in range(CUTS)])
    assert read <= (CUTS // 2 if name in ("csv", "tsv") else 1)  # a row may end at the cut
    assert all(str(path) in error for error in errors)
    assert "is empty (0 bytes)" in errors[0]


@pytest.mark.parametrize(
    ("number", "mark", "lost", "text"),
    [
        ("{:.4f}", ".", 1, "'4.812' without a line ending, .* have more decimals"),
        ("{:.4f}", ",", 2, "'4,81' without a line ending, .* have more decimals"),
        ("{!r}", ".", 9, "without a line ending, but all numbers above it are longer"),
        ("{:.5e}", ".", 4, "'4.81260' without a line end"),
    ],
)
def test_a_table_that_ends_within_a_number(tmp_path, number, mark, lost, text):
    """A missing line end alone is no damage, nor is a short number that has one."""
    path = tmp_path / "a.csv"
    rows = [f"{0.01 * k:.2f};{number.format(0.1234 * k * (1 + 1e-12))}" for k in range(40)]
    whole = "\n".join(["time [s];y [m]", *rows]).replace(".", mark)
    path.write_text(whole)
    assert read_measurement(path)["y"].size == 40
    path.write_text(whole[:-lost])
    with pytest.raises(FileError, match=rf"line 41 .*{text}"):
        read_measurement(path)
    path.write_text(whole[:-lost] + "\n")
    assert read_measurement(path)["y"].size == 40


def test_a_cut_shows_beside_a_number_that_is_as_short(tmp_path):
    """A few short ones, as where a ride begins at rest, do not hide it; many do."""
    path, rng = tmp_path / "a.csv", np.random.default_rng(2)
    for number, text in (
        (lambda v: repr(float(v)), "are longer"),
        ("{:.4f}".format, "have more decimals"),
    ):
        cells = ["0", "0", *(number(0.1 + 0.1 * v) for v in rng.uniform(size=70))]
        rows = [f"{0.01 * k:.2f},{cell}" for k, cell in enumerate([*cells, "0.12"])]
        path.write_text("\n".join(["time [s],y [m]", *rows]))
        with pytest.raises(FileError, match=rf"line 74 .*'0.12' .*all but 1 numbers .* {text}"):
            read_measurement(path)
    rows = [f"{0.01 * k:.2f},{0.5 * k:g}" for k in range(60)]
    path.write_text("\n".join(["time [s],y [m]", *rows, "0.60,30"]))
    assert read_measurement(path)["y"].size == 61


def test_flipped_bytes(tmp_path, name):
    path = file_of(tmp_path, name, measurement(60))
    whole = path.read_bytes()
    rng = np.random.default_rng(11)
    contents = []
    for k in range(FLIPS):
        content = bytearray(whole)
        reach = min(2048, len(whole)) if k % 2 else len(whole)
        content[int(rng.integers(reach))] ^= int(rng.integers(1, 256))
        contents.append(bytes(content))
    _, errors = outcomes(path, contents)
    assert errors
    assert all(str(path) in error and "\n" not in error for error in errors)


@pytest.mark.parametrize("ending", [".csv", ".parquet", ".mat", ".mf4", ".nc"])
def test_noise(tmp_path, ending):
    path = tmp_path / f"noise{ending}"
    path.write_bytes(np.random.default_rng(0).bytes(4000))
    with pytest.raises(FileError, match="contains something else"):
        read_measurement(path)


def mat_element(shape, data, flags=6):
    """Return the content of an array element of a MAT file."""
    head = struct.pack("<IIII", 6, 8, flags, 0) + struct.pack("<IIii", 5, 8, *shape)
    return head + struct.pack("<II", 0x10001, ord("y")) + data


def mat_file(path, element, kind=14, declared=None):
    """Write a MAT file of one element."""
    size = len(element) if declared is None else declared
    header = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    path.write_bytes(header + struct.pack("<II", kind, size) + element)
    return path


def test_mat_elements_that_lie(tmp_path, monkeypatch):
    monkeypatch.setattr(limited_source, "MOST_MEMORY", 2**28)
    path, by_rate = tmp_path / "a.mat", {"rate": "1 Hz", "signals": {"y": {"unit": "m"}}}
    numbers = struct.pack("<II", 9, 16) + bytes(16)
    lies = [
        (mat_element((1, 2**20), numbers), 14, "damaged"),  # more numbers than are stored
        (mat_element((1, -2), numbers), 14, "no column 'y'|damaged"),
        (mat_element((1, 2), struct.pack("<II", 99, 16) + bytes(16)), 14, "SIGSEGV|damaged"),
        (mat_element((1, 2), struct.pack("<II", 9, 2**31) + bytes(16)), 14, "memory|damaged"),
        (mat_bomb(), 15, "needs more than 0.25 GiB of memory"),
    ]
    for element, kind, text in lies:
        with pytest.raises(FileError, match=text) as caught:
            read_measurement(mat_file(path, element, kind), by_rate)
        assert str(path) in str(caught.value)
    for declared in (None, 2**31):  # more than there is, which the array inside does not need
        sound = mat_file(path, mat_element((1, 2), numbers), declared=declared)
        assert read_measurement(sound, by_rate)["y"].values.tolist() == [0.0, 0.0]


PIECE = bytes(2**20)


def packed(head, pieces):
    """Return a head and pieces of zeros as zlib packs them; one is packed, and repeated."""
    machine = zlib.compressobj(9, zlib.DEFLATED, -15)
    content = machine.compress(head) + machine.flush(zlib.Z_FULL_FLUSH)
    content += (machine.compress(PIECE) + machine.flush(zlib.Z_FULL_FLUSH)) * pieces
    check = zlib.adler32(head)
    for _ in range(pieces):
        check = zlib.adler32(PIECE, check)
    return b"\x78\xda" + content + machine.flush() + struct.pack(">I", check)


def test_bombs_are_sound():
    head = b"begins"
    assert zlib.decompress(packed(head, 2)) == head + 2 * PIECE


def mat_bomb():
    """Return a compressed element that inflates to 512 MB of zeros."""
    size = 512 * len(PIECE)
    head = struct.pack("<II", 14, size + 64) + mat_element(
        (1, size // 8), struct.pack("<II", 9, size)
    )
    return packed(head, 512)


def test_mat_files_with_a_name_twice(tmp_path):
    savemat(tmp_path / "a.mat", {"y": np.arange(3.0)})
    data = (tmp_path / "a.mat").read_bytes()
    (tmp_path / "a.mat").write_bytes(data + data[128:])
    with pytest.raises(FileError, match="'y' twice"):
        read_measurement(tmp_path / "a.mat")


def test_hdf5_arrays_that_were_never_written(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for key in ("time", "y"):
            file.create_dataset(key, (HUGE,), "f8", chunks=(1000,)).attrs["unit"] = "s"
    with pytest.raises(FileError, match=r"declares 1.49e\+07 GiB"):
        read_measurement(tmp_path / "a.h5")
    with pytest.raises(FileError, match="'y' were never written"):
        read_measurement(tmp_path / "a.h5", {"rate": "1 Hz"}, signals=["y"], largest=9 * HUGE)


def test_hdf5_arrays_in_other_files_are_not_opened(tmp_path):
    h5py = pytest.importorskip("h5py")
    (tmp_path / "secret").write_bytes(bytes(800))
    with h5py.File(tmp_path / "a.h5", "w") as file:
        outer = [(str(tmp_path / "secret"), 0, 800)]
        file.create_dataset("y", (100,), "f8", external=outer).attrs["unit"] = "m"
    with pytest.raises(FileError, match="is stored in other files"):
        read_measurement(tmp_path / "a.h5", {"rate": "1 Hz"})


@pytest.mark.parametrize("ending", [".h5", ".mat"])
def test_netcdf_files_are_not_read_as_bare_hdf5(tmp_path, ending):
    """Their numbers may be packed, and HDF5 would give them as they are stored."""
    pytest.importorskip("h5py")
    path = tmp_path / f"a{ending}"
    measurement().to_netcdf(
        path,
        engine="netcdf4",
        encoding={"x_mc": {"dtype": "i2", "scale_factor": 1e-3, "_FillValue": -32768}},
    )
    with pytest.raises(FileError, match=r"is a NetCDF file. Rename it"):
        read_measurement(path)
    np.testing.assert_allclose(
        read_measurement(path, {"format": "netcdf"})["x_mc"], measurement()["x_mc"], atol=6e-4
    )


def test_netcdf_counts_that_lie(tmp_path):
    path = tmp_path / "a.nc"
    measurement().to_netcdf(path, format="NETCDF3_CLASSIC", engine="netcdf4")
    data = path.read_bytes()
    at = data.index(struct.pack(">II", 12, 3))  # the attributes of the first variable
    path.write_bytes(data[:at] + struct.pack(">II", 12, 2**31) + data[at + 8 :])
    with pytest.raises(FileError, match=r"damaged: .*malloc|memory"):
        read_measurement(path)


def mdf_with(tmp_path, block, offset, layout, value):
    """Return an MDF file in which a field of its first block of a kind has another value."""
    path = file_of(tmp_path, "mdf4")
    data = bytearray(path.read_bytes())
    at = data.index(block)
    wanted = at if value == "itself" else value
    struct.pack_into(layout, data, at + offset, wanted)
    path.write_bytes(data)
    return path


@pytest.mark.parametrize(
    ("block", "offset", "layout", "value", "text"),
    [
        (b"##DG", 24, "<Q", "itself", "no progress for 0.5 s|of memory"),
        (b"##CN", 24, "<Q", "itself", "no progress for 0.5 s|of memory"),
        (b"##DG", 32, "<Q", 2**40, "is damaged: bywire cannot read it as an MDF file"),
        (b"##CG", 24 + 48 + 8, "<Q", HUGE, "the limit is 8 GiB"),
        (b"##CG", 24 + 48 + 8, "<Q", 401, "401 records .*400 could be read"),
        (b"##CN", 24 + 64 + 4, "<I", 2**20, "extends to byte 1048584"),
        (b"##CN", 24 + 64 + 4, "<I", 20, "extends to byte 28"),
        (b"##CN", 8, "<Q", HUGE, "is damaged: bywire cannot read it as an MDF file"),
    ],
)
def test_mdf_blocks_that_lie(tmp_path, monkeypatch, block, offset, layout, value, text):
    pytest.importorskip("asammdf")
    monkeypatch.setattr(limited_source, "SECONDS", 0.5 if value == "itself" else 20.0)
    with pytest.raises(FileError, match=text):
        read_measurement(mdf_with(tmp_path, block, offset, layout, value), largest=8 * 2**30)


def test_mdf_records_in_a_block_that_cannot_be_inflated(tmp_path):
    """The library stops there without a word, and leaves whatever lies in memory."""
    asammdf = pytest.importorskip("asammdf")
    time, path = np.arange(6000) * 1e-3, tmp_path / "a.mf4"
    before = {
        key: asammdf.get_global_option(key) for key in ("read_fragment_size", "write_fragment_size")
    }
    try:
        for key in before:
            asammdf.set_global_option(key, 8192)
        with asammdf.MDF(version="4.10") as file:
            file.append([asammdf.Signal(np.sin(time), time, name="y", unit="m")])
            file.save(path, compression=2)
        data = bytearray(path.read_bytes())
        data[data.rindex(b"##DZ") + 100] ^= 1
        path.write_bytes(data)
        with (
            KNOWN.find("mdf4").open(path, ReadOptions()) as source,
            pytest.raises(FileError, match=r"6000 records .* but .*could be read"),
        ):
            list(source.pieces(["y"]))
    finally:
        for key, value in before.items():
            asammdf.set_global_option(key, value)


def test_mdf_blocks_that_inflate_too_far(tmp_path, monkeypatch):
    """Three records of 96 MB in 300 kB, of which 24 bytes are asked for."""
    pytest.importorskip("asammdf")
    monkeypatch.setattr(limited_source, "MOST_MEMORY", 2**28)
    path = mdf_with(tmp_path, b"##CG", 24 + 48 + 8, "<Q", 3)
    data, size = bytearray(path.read_bytes()), 96 * len(PIECE)
    content = packed(b"", 3 * 96)
    struct.pack_into("<I", data, data.index(b"##CG") + 24 + 48 + 24, size)
    struct.pack_into("<Q", data, data.index(b"##DG") + 24 + 16, len(data))
    head = struct.pack("<2sBBIQQ", b"DT", 0, 0, 0, 3 * size, len(content))
    data += struct.pack("<4sIQQ", b"##DZ", 0, 24 + len(head) + len(content), 0) + head + content
    path.write_bytes(data)
    with pytest.raises(FileError, match=r"3 records .* and 0 could be read|of memory"):
        read_measurement(path)


@pytest.mark.parametrize("size", [0.9, 0.999])
def test_a_classic_netcdf_file_that_is_cut(tmp_path, size):
    """The library gives zeros for what is not there."""
    path = tmp_path / "a.nc"
    measurement(6000).to_netcdf(path, format="NETCDF3_CLASSIC", engine="netcdf4")
    data = path.read_bytes()
    path.write_bytes(data[: int(size * len(data))])
    with pytest.raises(FileError, match="is damaged"):
        read_measurement(path, signals=["p_mc"])


@pytest.mark.parametrize(
    ("head", "text"),
    [(b"UnFinMF ", "is incomplete"), (b"MDF     3.30    ", "is MDF 3.30. Convert it to MDF 4")],
)
def test_other_mdf_files(tmp_path, head, text):
    pytest.importorskip("asammdf")
    path = file_of(tmp_path, "mdf4")
    path.write_bytes(head + path.read_bytes()[len(head) :])
    with pytest.raises(FileError, match=text):
        read_measurement(path)
