"""What is told of a background."""

from __future__ import annotations

from adaptive_flot.discovery.record.background import Background
from adaptive_flot.discovery.results.words import rough


def background_words(background: Background, units: dict[str, str]) -> str:
    """What wanders and how, and how far the constants are off, in sentences; `units` are those of the sites."""
    said, course = [], background.course
    if course is not None:
        size = f"{course.std:.3g} {units[course.site]}".rstrip() if course.offset else f"{rough(100 * course.std)} %"
        said.append(
            f"The {course.site} wanders: standard deviation about {size}, correlation time about {course.time:.0f} s. "
            "Its course was estimated beside every alternative, and is in the errors before and after. What acts as "
            "this feed does, and changes as slowly, would look the same."
        )
    if background.constants:
        said.append(
            "Constants of the process are not quite those of the model: they differ by about "
            f"{100 * background.constants:.0f} % each. All of them were estimated beside every alternative."
        )
    return " ".join(said)


def estimated(
    background: Background, course: str = "the estimated course", constants: str = "estimated constants"
) -> str:
    """What was estimated beside every alternative, as a phrase; the two parts may be put in other words."""
    parts = [] if background.course is None else [f"{course} of {background.course.site}"]
    return " and ".join(parts + ([f"{constants} of the process"] if background.constants else []))


def subject(background: Background) -> str:
    """The same as the subject of a sentence, with its verb."""
    return f"{estimated(background, 'a course', 'constants')} {'were' if background.constants else 'was'}"
