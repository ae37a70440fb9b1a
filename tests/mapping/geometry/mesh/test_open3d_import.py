"""The one door to Open3D: what is missing is named, what was unpacked is loaded."""

import builtins
import ctypes
import sys

import pytest

from mapping.errors import Open3DError
from mapping.geometry.mesh import open3d_import
from mapping.geometry.mesh.open3d_import import open3d, preload


@pytest.fixture
def no_open3d(monkeypatch):
    """An environment whose open3d lacks libusb."""
    real = builtins.__import__

    def refuse(name, *args, **kwargs):
        if name.split(".")[0] == "open3d":
            raise ImportError("libusb-1.0.so.0: cannot open shared object file: No such file or directory")
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", refuse)
    monkeypatch.delitem(sys.modules, "open3d", raising=False)
    open3d_import.open3d.cache_clear()
    yield
    open3d_import.open3d.cache_clear()


def test_a_missing_library_is_named_with_the_remedy(no_open3d):
    with pytest.raises(Open3DError, match=r"libusb-1\.0\.so\.0.*explore3d doctor.*make setup"):
        open3d()


def test_libraries_are_loaded_for_everyone_in_whatever_order_they_need_one_another(tmp_path, monkeypatch):
    for name in ("liba.so.1", "libb.so.1", "libc.so.1"):
        (tmp_path / name).touch()
    loaded = []

    def load(path, mode):
        name = path.rsplit("/", 1)[1]
        if name == "liba.so.1" and "libc.so.1" not in loaded:
            raise OSError("libc.so.1: cannot open shared object file")
        assert mode == ctypes.RTLD_GLOBAL
        loaded.append(name)

    monkeypatch.setattr(ctypes, "CDLL", load)
    assert preload(tmp_path) == {}
    assert set(loaded) == {"liba.so.1", "libb.so.1", "libc.so.1"}


def test_a_library_that_does_not_load_is_reported(tmp_path):
    (tmp_path / "libbroken.so").write_text("no library")
    assert list(preload(tmp_path)) == ["libbroken.so"]


def test_no_folder_is_nothing_to_load(tmp_path):
    assert preload(tmp_path / "absent") == {}
