"""A typed door to numba, so that strict type checking sees through the decorator."""

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

_PACKAGE = Path(__file__).parent.parent
# Where kernels are.
_ROOMS = ("physics", "control", "estimator")


def njit(function: Kernel) -> Kernel:
    """Compile ``function`` to machine code and keep it for the next start.

    No fast-math: reordering sums would make the answers depend on the compiler's mood, and the
    same seed has to give the same bytes.
    """
    return cast(Kernel, numba.njit(cache=True, fastmath=False)(function))


def inlined(function: Kernel) -> Kernel:
    """The same, put into whatever calls it: for small functions that are called with whole arrays again and again."""
    return cast(Kernel, numba.njit(cache=True, fastmath=False, forceinline=True)(function))


@intrinsic  # type: ignore[untyped-decorator]
def borrowed(_typing: Any, array: Any) -> Any:
    """The same array, in a kernel, without a count of who uses it: whoever called the kernel keeps it alive.

    Counting is an atomic operation at every call of a function that gets the array.
    """

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        view = make_array(signature.return_type)(context, builder, arguments[0])
        view.meminfo = view.meminfo.type(None)  # LLVM's null pointer
        return view._getvalue()

    return array(array), codegen


def _keep_code_by_content() -> None:
    """Keep compiled code in a folder named after the kernels' text.

    Numba looks only at the file of the outermost function, so that a changed callee in another file
    would go on running as it was. Where the folder cannot be written numba's own place serves.
    """
    digest = hashlib.sha256()
    for path in sorted([*(path for room in _ROOMS for path in _PACKAGE.glob(f"{room}/*.py")), _PACKAGE / "world.py"]):
        digest.update(path.read_bytes())
    parent = _PACKAGE / "__pycache__"
    if os.access(parent if parent.exists() else _PACKAGE, os.W_OK):
        numba.config.CACHE_DIR = str(parent / f"kernels-{digest.hexdigest()[:12]}")


_keep_code_by_content()
