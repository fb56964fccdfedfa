from typing import Any

ffi: Any  # The declarations are in binding/interface.h.
lib: Any
