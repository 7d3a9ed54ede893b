"""Archives that would harm are refused with one line before anything of them is written."""

import os
import stat
import struct
import warnings
import zipfile

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hovercontrol.base.errors import InputError
from hovercontrol.fmi import load
from hovercontrol.fmi.importer.archive import Limits, check_xml, open_archive

SMALL = Limits(total=3 * 2**20, entries=20, depth=4, path=100)
GOOD = b'<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="2.0"/>'


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.fmu"


def pack(path, *entries, method=zipfile.ZIP_DEFLATED):
    """Write an archive of names, (name, bytes) or (ZipInfo, bytes)."""
    with warnings.catch_warnings(), zipfile.ZipFile(path, "w", method) as archive:
        warnings.simplefilter("ignore")  # zipfile warns of duplicate names
        for entry in entries:
            name, data = entry if isinstance(entry, tuple) else (entry, b"x")
            archive.writestr(name, data)
    return path


def unpack(path, limits=SMALL):
    """Unpack beside the archive; return the names and what appeared."""
    target = path.parent / "out"
    target.mkdir()
    with open_archive(path, limits) as archive:
        archive.unpack(target, lambda name: True)
        names = archive.names
    found = sorted(str(p.relative_to(target)) for p in target.rglob("*") if p.is_file())
    assert found == sorted(names)
    return names


def refused(path, limits=SMALL):
    """Return the line of the refusal, and see that nothing was written anywhere."""
    before = sorted(path.parent.rglob("*"))
    with pytest.raises(InputError) as caught, open_archive(path, limits):
        pass
    assert sorted(path.parent.rglob("*")) == before
    line = str(caught.value)
    assert str(path) in line and "\n" not in line
    return line


def test_a_plain_archive_is_unpacked_whole_and_nothing_that_is_not_wanted(path):
    pack(path, ("modelDescription.xml", GOOD), "binaries/linux64/m.so", "resources/a/b.txt", "documentation/")
    assert unpack(path) == ["modelDescription.xml", "binaries/linux64/m.so", "resources/a/b.txt"]
    chosen = path.parent / "chosen"
    chosen.mkdir()
    with open_archive(path) as archive:
        assert archive.read("modelDescription.xml", 1000) == GOOD
        archive.unpack(chosen, lambda name: name.startswith("resources/"))
    assert [str(p.relative_to(chosen)) for p in chosen.rglob("*") if p.is_file()] == ["resources/a/b.txt"]


@pytest.mark.parametrize(
    "name, line",
    [
        ("../evil.txt", "has a path outside the FMU"),
        ("resources/../../evil.txt", "has a path outside the FMU"),
        ("resources/..", "has a path outside the FMU"),
        ("/etc/evil.txt", "has an absolute name"),
        ("//host/evil.txt", "has an absolute name"),
        ("C:/evil.txt", "has an absolute name"),
        ("c:evil.txt", "has an absolute name"),
        ("..\\evil.txt", "has a backslash in its name"),
        ("resources\\evil.txt", "has a backslash in its name"),
        ("resources//evil.txt", "has a name that is none on every system"),
        ("./evil.txt", "has a name that is none on every system"),
        ("resources/a:stream", "has a name that is none on every system"),
        ("resources/nul", "has a name that is none on every system"),
        ("resources/Con.txt", "has a name that is none on every system"),
        ("resources/a\nb", "has a name that is none on every system"),
        ("resources/" + "n" * 300, "has a name that is none on every system"),
        ("n" * 60 + "/" + "n" * 60, "has a longer name than 100 characters"),
        ("a/b/c/d/e", "deeper than 4 folders"),
    ],
)
def test_names_that_lead_elsewhere_are_refused(path, name, line):
    pack(path, ("modelDescription.xml", GOOD), name)
    assert line in refused(path)


@pytest.mark.parametrize("name", ["resources/innocent.txt\0/../../evil", "a\0b"])
def test_a_name_cut_by_a_zero_byte_is_refused(path, name):
    pack(path, name.replace("\0", "?"))
    data = path.read_bytes().replace(name.replace("\0", "?").encode(), name.encode())
    path.write_bytes(data)
    assert "has a path outside the FMU" in refused(path) or "none on every system" in refused(path)


@pytest.mark.parametrize(
    "names",
    [
        ("resources/a.txt", "resources/A.TXT"),
        ("resources/a.txt", "Resources/b.txt"),
        ("resources/a", "resources/a/b"),
        ("resources/a/b", "resources/a"),
        ("resources/a/b", "resources/A"),
        ("resources/\u00e4", "resources/a\u0308"),
        ("resources/\u00df", "resources/SS"),
        ("resources/a.", "resources/a"),
    ],
)
def test_names_that_fall_on_one_another_are_refused(path, names):
    pack(path, *names)
    assert "has the same path as" in refused(path)


def test_a_file_may_be_there_twice_only_if_it_is_the_same(path):
    assert unpack(pack(path, "a", "b", "a")) == ["a", "b"]
    assert "has the same path as 'a'" in refused(pack(path, ("a", b"one"), ("a", b"two")))
    pack(path, ("a", b"one"), ("a", b"two"))
    data, crc = path.read_bytes(), zipfile.crc32(b"one").to_bytes(4, "little")
    path.write_bytes(data.replace(zipfile.crc32(b"two").to_bytes(4, "little"), crc))
    assert "'a' is broken" in refused(path)  # equal by the directory, not by its bytes


def test_folders_may_be_named_or_not(path):
    pack(path, "resources/", "resources/a/", "resources/a/b", "resources/c")
    assert unpack(path) == ["resources/a/b", "resources/c"]


def unusual(name, mode=0, **attributes):
    info = zipfile.ZipInfo(name)
    info.create_system, info.external_attr = 3, mode << 16
    for key, value in attributes.items():
        setattr(info, key, value)
    return info


@pytest.mark.parametrize(
    "mode, line",
    [
        (stat.S_IFLNK | 0o777, "is a link"),
        (stat.S_IFIFO, "is not a regular file"),
        (stat.S_IFCHR, "is not a regular file"),
    ],
)
def test_links_and_devices_are_refused(path, mode, line):
    pack(path, (unusual("resources/link", mode), b"/etc/passwd"))
    assert line in refused(path)


def patched(path, offset_in_entry, value, size=2):
    """Change a field of the last entry, in its local header and in the directory."""
    data = bytearray(path.read_bytes())
    local, central = data.rfind(b"PK\x03\x04"), data.rfind(b"PK\x01\x02")
    for start in (local + offset_in_entry, central + offset_in_entry + 2):
        data[start : start + size] = value.to_bytes(size, "little")
    path.write_bytes(data)
    return path


def test_encrypted_and_unusual_packing_is_refused(path):
    assert "is encrypted" in refused(patched(pack(path, "a"), 6, 1))
    assert "by another method than deflate" in refused(patched(pack(path, "a"), 8, 97))
    assert "by another method" in refused(pack(path, "a", method=zipfile.ZIP_BZIP2))
    assert "by another method" in refused(pack(path, "a", method=zipfile.ZIP_LZMA))


def test_too_many_entries_bytes_or_a_bomb_are_refused(path):
    assert "holds 21 entries; an FMU may hold 20" in refused(pack(path, *(f"f{i}" for i in range(21))))
    noise = os.urandom(2**20)
    many = [(f"f{i}", noise) for i in range(4)]
    assert "would unpack to 4194304 bytes, more than the limit of 3145728" in refused(pack(path, *many))
    assert "times its size" in refused(pack(path, ("zeros", bytes(3 * 2**20 - 1))))
    few = [(f"f{i}", bytes(2**20 // 2)) for i in range(5)] + [("noise", noise[:9000])]
    assert len(unpack(pack(path, *few))) == 6  # small files may be as dense as they like
    assert "more than the limit of 1000" in refused(
        pack(path, ("noise", noise)), SMALL._replace(archive=1000)
    )


def test_sizes_are_those_of_the_bytes_that_come_out(path):
    """The directory says 10 bytes, or a thousand too many; the limits hold for what is really there."""
    noise = os.urandom(2**20)
    for claimed in (10, 2**20 + 1000):
        patched(pack(path, ("resources/f", noise)), 22, claimed, 4)
        (path.parent / "out").mkdir(exist_ok=True)
        with open_archive(path) as archive, pytest.raises(InputError, match="'resources/f' is broken"):
            archive.unpack(path.parent / "out", lambda name: True)
        (path.parent / "out/resources/f").unlink()


def test_a_bomb_that_claims_to_be_small_stops_early(path):
    """Header and checksum agree on a small size, and the packed bytes hold a hundred times as many."""
    pack(path, ("bomb", bytes(50 * 2**20)))
    info = zipfile.ZipFile(path).infolist()[0]
    patched(path, 22, 100, 4)
    patched(path, 14, zipfile.crc32(bytes(100)), 4)
    assert info.file_size == 50 * 2**20
    with open_archive(path) as archive:
        assert archive.read("bomb", 1000) == bytes(100)


def test_read_and_unpack_stop_at_their_limits(path):
    noise = os.urandom(2**20)
    pack(path, ("a", noise), ("b", noise), ("c", noise))
    (path.parent / "out").mkdir()
    with open_archive(path) as archive:
        with pytest.raises(InputError, match="'a' unpacks to more than the limit of an FMU"):
            archive.read("a", 1000)
        with pytest.raises(InputError, match=r"found an archive without modelDescription\.xml"):
            archive.read("modelDescription.xml", 1000)
    with open_archive(path, SMALL) as archive:
        archive._limits = SMALL
        archive._left = 2**21 + 10  # as if the directory had told less
        with pytest.raises(InputError, match="'c' unpacks to more than the limit of an FMU"):
            archive.unpack(path.parent / "out", lambda name: True)


def test_entries_that_share_their_bytes_are_refused(path):
    """One packed file listed often makes a bomb without any single suspicious entry."""
    pack(path, ("a", os.urandom(50_000)), ("b", b"y"))
    data = bytearray(path.read_bytes())
    second = data.rfind(b"PK\x01\x02")
    data[second + 42 : second + 46] = struct.pack("<I", 40)
    path.write_bytes(data)
    assert "overlaps another entry" in refused(path)


def test_a_directory_larger_than_any_fmus_is_not_read(path):
    pack(path, "a")
    data = path.read_bytes()
    end = data.rfind(b"PK\x05\x06")
    size = 200 * 2**20
    with open(path, "wb") as file:
        file.seek(size)  # a sparse file: a directory of 200 MiB
        file.write(data[end : end + 12] + struct.pack("<II", size, 0) + b"\0\0")
    assert f"not an FMU: a directory of {size} bytes" in refused(path)


def test_what_is_no_archive_is_said(path, tmp_path):
    for data in (b"", b"no archive", pack(path, "a").read_bytes()[:-10], b"PK\x05\x06" + b"\xff" * 18):
        path.write_bytes(data)
        assert "not an FMU: " in refused(path)
    with pytest.raises(InputError, match=r"nothing\.fmu cannot be read: No such file"):
        load(tmp_path / "nothing.fmu")
    with pytest.raises(InputError, match="is not a file"):
        load(tmp_path)
    os.mkfifo(tmp_path / "pipe.fmu")
    with pytest.raises(InputError, match="is not a file"):
        load(tmp_path / "pipe.fmu")
    with pytest.raises(InputError, match=r"found an archive without modelDescription\.xml"):
        load(pack(path, "a"))


@given(st.data())
def test_damaged_archives_are_refused_or_read_but_never_crash(tmp_path_factory, data):
    """Any bytes changed or cut: the archive opens as before, or there is one line."""
    folder = tmp_path_factory.mktemp("damaged")
    path = pack(folder / "a.fmu", ("modelDescription.xml", GOOD), ("resources/a", b"text" * 50), "b")
    raw = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(raw[: data.draw(st.integers(0, len(raw)))] if data.draw(st.booleans()) else raw)
    out = folder / "out"
    out.mkdir()
    try:
        with open_archive(path, SMALL) as archive:
            archive.unpack(out, lambda name: True)
    except InputError as error:
        assert "\n" not in str(error)
    assert {p.parent for p in folder.iterdir()} == {folder} and len(list(folder.iterdir())) == 2


# --- the description ---

BOMB = b"""<?xml version="1.0"?>
<!DOCTYPE lolz [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>
<fmiModelDescription fmiVersion="2.0" modelName="&b;"/>"""
EXTERNAL = b"""<!DOCTYPE a SYSTEM "file:///etc/passwd"><fmiModelDescription fmiVersion="2.0"/>"""
PARAMETER = b"""<!DOCTYPE a [<!ENTITY % p SYSTEM "http://127.0.0.1:9/x"> %p;]><fmiModelDescription/>"""


@pytest.mark.parametrize("text", [BOMB, EXTERNAL, PARAMETER, b"\xef\xbb\xbf" + EXTERNAL])
def test_document_types_and_entities_are_refused_before_a_parser_expands_them(path, text):
    with pytest.raises(InputError, match="expected no document type and no entities") as caught:
        load(pack(path, ("modelDescription.xml", text)))
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("coding", ["utf-16", "utf-16-le", "utf-16-be", "utf-32"])
def test_a_document_type_cannot_hide_in_another_encoding(coding):
    with pytest.raises(InputError, match="expected XML in UTF-8"):
        check_xml(BOMB.decode().encode(coding), "m.xml")


@pytest.mark.parametrize("coding", ["utf-7", "UTF-16", "cp037", "iso-2022-jp", "nonsense"])
def test_encodings_that_fmi_does_not_use_are_refused(coding):
    text = f'<?xml version="1.0" encoding="{coding}"?><fmiModelDescription/>'.encode()
    with pytest.raises(InputError, match=r"expected XML in UTF-8, found the encoding|is not XML"):
        check_xml(text, "m.xml")


def test_the_first_element_is_returned():
    assert check_xml(GOOD, "m.xml") == ("fmiModelDescription", {"fmiVersion": "2.0"})
    assert check_xml(GOOD.replace(b"UTF-8", b"ISO-8859-1") + b"<!-- \xe4 -->", "m.xml").attributes


@pytest.mark.slow("text6")
@pytest.mark.parametrize(
    "text, line",
    [
        (b"", "is not XML: no element found"),
        (b"<a>", "is not XML: no element found"),
        (b"<a></b>", "is not XML: mismatched tag"),
        (b"<a>\xff\xfe</a>", "is not XML: not well-formed"),
        (b"<a>&b;</a>", "is not XML: undefined entity"),
        (b"<a>" * 65 + b"</a>" * 65, "more than 64 levels"),
        (b"<a>" + b"<b/>" * 2_000_000 + b"</a>", "or 2000000 elements"),
    ],
)
def test_broken_deep_or_endless_descriptions_are_refused(text, line):
    with pytest.raises(InputError, match=line):
        check_xml(text, "m.xml")


def test_a_description_may_not_be_longer_than_its_limit(path):
    text = b"<a>" + b"x" * (120 * 2**20) + b"</a>"
    with pytest.raises(InputError, match=r"'modelDescription\.xml' unpacks to more than the limit of an FMU"):
        load(pack(path, ("modelDescription.xml", text), method=zipfile.ZIP_STORED))
