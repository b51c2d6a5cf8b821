"""Python as it is where only the base of `lfa` is installed: the packages of its extras are not found."""

import sys
from importlib.machinery import ModuleSpec, PathFinder

EXTRAS = {
    "numpy", "PIL", "pymunk", "matplotlib", "mcap", "rerun", "zstandard", "rich", "asyncssh", "cryptography", "rosbags",
    "xxhash", "foxglove", "yaml", "websockets", "pyarrow", "submitit", "distributed", "gymnasium", "pettingzoo",
}  # fmt: skip


class BaseFinder(PathFinder):
    @classmethod
    def find_spec(cls, fullname: str, path: object = None, target: object = None) -> ModuleSpec | None:
        known = fullname.partition(".")[0] not in EXTRAS
        return super().find_spec(fullname, path, target) if known else None  # type: ignore[arg-type]


sys.meta_path[:] = [BaseFinder if finder is PathFinder else finder for finder in sys.meta_path]
