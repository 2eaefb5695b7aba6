"""A typed door to numba, so that strict type checking sees through the decorator."""

import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import platformdirs
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

_PACKAGE = Path(__file__).parent.parent
# Where kernels are, and numbers that they are compiled with.
_ROOMS = ("physics", "control", "estimator", "airframe.py", "world.py")


def njit(function: Kernel) -> Kernel:
    """Compile ``function`` to machine code and keep it for the next start.

    No fast-math: reordering sums would make the answers depend on the compiler's mood, and the
    same seed has to give the same bytes.
    """
    return cast(Kernel, numba.njit(cache=NOT_KEPT is None, fastmath=False)(function))


def inlined(function: Kernel) -> Kernel:
    """The same, put into whatever calls it: what is called in every step of the physics.

    An array is handed over as nine numbers, which costs such a function more than its own work.
    """
    return cast(Kernel, numba.njit(cache=NOT_KEPT is None, fastmath=False, forceinline=True)(function))


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


def _kernels_folder(parent: str) -> str:
    """A folder named after the kernels' text.

    Numba looks only at the file of the outermost function, so that a changed callee in another file
    would go on running as it was.
    """
    digest = hashlib.sha256()
    for path in sorted(path for path in _PACKAGE.rglob("*.py") if path.relative_to(_PACKAGE).parts[0] in _ROOMS):
        digest.update(path.read_bytes())
    return os.path.join(parent, f"kernels-{digest.hexdigest()[:12]}")


def _keep_code() -> str | None:
    """Below NUMBA_CACHE_DIR, else the user's own cache folder; why nothing can be kept, where that is so."""
    folder = _kernels_folder(numba.config.CACHE_DIR or platformdirs.user_cache_dir("px4-rebound"))
    if folder.startswith("~"):
        return "this user has no home folder"
    try:
        os.makedirs(folder, exist_ok=True)
        # As numba does it: a folder's permissions say nothing of a disk that is read-only.
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        return f"{folder}: {error.strerror}"
    numba.config.CACHE_DIR = folder
    return None


NOT_KEPT = _keep_code()
"""Why compiled kernels are compiled again at every start, if they are."""
