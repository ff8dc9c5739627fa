"""Tags of a link file that come from the map of an import, so that a plant is described once."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from adaptive_flot.errors import LinkError, located
from adaptive_flot.records.tag_map import load_tag_map


def with_map(content: Mapping[str, Any], path: Path) -> dict[str, Any]:
    """Content of a link file, its `tags` completed from the file that its key `map` names.

    What `tags` says of a quantity goes before what the map says, key by key.

    Parameters
    ----------
    content
        Content of the link file, before it is checked.
    path
        The link file; the map lies beside it, or where its path says.

    Raises
    ------
    LinkError
        The map can not be used, gives no unit, or an input as a constant for which there is no tag.
    """
    name, own = content.get("map"), content.get("tags", {})
    if not isinstance(name, str) or not isinstance(own, Mapping):
        return dict(content)  # the check of the keys says what is wrong
    with located(path):
        tag_map = load_tag_map(path.parent / name)
    for constant in tag_map.constants:
        if constant not in own:
            raise LinkError(
                f"{path}: {name} gives {constant!r} as a constant, which a running plant does not confirm; name a tag "
                f"for it, as 'tags: {{{constant}: {{tag: ..., unit: ...}}}}'"
            )
    tags: dict[str, Any] = {}
    for quantity, keys in tag_map.quantities.items():
        said = own.get(quantity, {})
        if keys.unit is None and not (isinstance(said, Mapping) and "unit" in said):
            raise LinkError(f"{path}: {name} gives no unit for {quantity!r}; add it there")
        found = keys.model_dump(mode="json", exclude_defaults=True)
        tags[quantity] = {**found, **said} if isinstance(said, Mapping) else said
    return {**content, "tags": {**own, **tags}}
