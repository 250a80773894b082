"""bywire does not run kernels that another user may have written."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from bywire.core.errors import CompilerError
from bywire.simulation import compiler as compiler_module
from bywire.simulation.compiler import PLAIN, compile_library
from raising import raises
from simulation.small_library import SOURCE, system_compiler, twice


def test_folders_that_others_may_write_to_are_not_trusted(tmp_path, monkeypatch):
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o777)
    monkeypatch.setenv("BYWIRE_CACHE", str(shared))
    with raises(CompilerError, name="BYWIRE_CACHE", value=str(shared)):
        compiler_module.usable_folder()
    shared.chmod(0o700)
    assert compiler_module.usable_folder() == shared


PLANTED = "double twice(double x) { return 666.0; }\n"


def planted(library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace a library with foreign code that has a correct digest."""
    with monkeypatch.context() as patch:
        patch.setenv("BYWIRE_CACHE", str(tmp_path / "elsewhere"))
        foreign = compile_library(PLANTED, PLAIN, system_compiler())
    library.unlink()
    shutil.copy(foreign, library)
    shutil.copy(compiler_module.digest_of(foreign), compiler_module.digest_of(library))


def test_a_planted_library_does_not_run(cache, tmp_path, monkeypatch):
    """The digest is correct and the folder is private again, but others could write to the file."""
    compiler = system_compiler()
    library = compile_library(SOURCE, PLAIN, compiler)
    planted(library, tmp_path, monkeypatch)
    library.chmod(0o666)
    with raises(CompilerError, name=str(library)):
        compiler_module.load(library, "twice")
    assert twice(compile_library(SOURCE, PLAIN, compiler)) == 42.0


@pytest.mark.skipif(os.name == "nt" or os.getuid() != 0, reason="gives files to others")
@pytest.mark.parametrize("what", ["library", "digest", "folder", "above"])
def test_a_library_of_somebody_else_does_not_run(cache, tmp_path, monkeypatch, what):
    compiler = system_compiler()
    library = compile_library(SOURCE, PLAIN, compiler)
    planted(library, tmp_path, monkeypatch)
    digest = compiler_module.digest_of(library)
    os.chown({"library": library, "digest": digest, "folder": cache, "above": tmp_path}[what], 1, 1)
    assert not compiler_module.is_intact(library, "twice")
    if what in ("library", "digest"):
        assert twice(compile_library(SOURCE, PLAIN, compiler)) == 42.0
        assert library.stat().st_uid == 0
    else:
        with raises(CompilerError, name="BYWIRE_CACHE"):
            compile_library(SOURCE, PLAIN, compiler)
        with raises(CompilerError, name=str(library)):
            compiler_module.load(library, "twice")


def test_folders_above_count_unless_others_cannot_replace_what_is_not_theirs(tmp_path, monkeypatch):
    above = tmp_path / "above"
    inner = above / "inner"
    inner.mkdir(parents=True)
    monkeypatch.setenv("BYWIRE_CACHE", str(inner))
    above.chmod(0o777)
    with raises(CompilerError, name="BYWIRE_CACHE", value=str(inner)):
        compiler_module.usable_folder()
    above.chmod(0o1777)
    assert compiler_module.usable_folder() == inner
    link = tmp_path / "link"
    link.symlink_to(inner)
    above.chmod(0o777)
    monkeypatch.setenv("BYWIRE_CACHE", str(link))
    with raises(CompilerError, name="BYWIRE_CACHE", value=str(link)):
        compiler_module.usable_folder()


def test_the_usual_folder_is_left_alone_with_a_word(tmp_path, monkeypatch):
    open_folder = tmp_path / "cache"
    open_folder.mkdir()
    open_folder.chmod(0o777)
    monkeypatch.delenv("BYWIRE_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(open_folder))
    monkeypatch.setattr(compiler_module, "user_cache_path", lambda *_: open_folder / "bywire")
    with pytest.warns(UserWarning, match="does not cache kernels"):
        folder = compiler_module.usable_folder()
    assert folder != open_folder / "bywire" / "kernels"


def test_a_private_group_may_write(tmp_path, monkeypatch):
    """Many systems create a group for each user, which may write to the user's files."""
    folder = tmp_path / "group"
    folder.mkdir()
    folder.chmod(0o770)
    assert compiler_module.open_to_others(folder) == ""
    monkeypatch.setattr(compiler_module, "_is_private", lambda group: False)
    assert compiler_module.open_to_others(folder) == str(folder)
