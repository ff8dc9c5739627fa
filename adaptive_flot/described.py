"""Short text and HTML for objects that hold too much to be printed whole."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from html import escape


class Described(ABC):
    """An object that prints as one line, and as a small table in a notebook; use it with `dataclass(repr=False)`."""

    @abstractmethod
    def described(self) -> Mapping[str, object]:
        """What a reader wants to know first: label and value, most important first."""

    def __repr__(self) -> str:
        said = "; ".join(f"{label}: {value}" for label, value in self.described().items())
        return f"<{type(self).__name__} {said}>"

    def _repr_html_(self) -> str:
        entries = self.described().items()
        rows = "".join(f"<tr><th>{escape(label)}</th><td>{escape(str(value))}</td></tr>" for label, value in entries)
        return f"<table style='text-align: left'><caption>{type(self).__name__}</caption>{rows}</table>"
