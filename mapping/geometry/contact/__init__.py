"""Contact of a ball with a mesh: first contact, the parallel surface and its caustics."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.geometry.contact.first_contact import BallContact as BallContact, Contacts as Contacts
    from mapping.geometry.contact.interference_points import interference_points as interference_points
    from mapping.geometry.contact.parallel_surface import (
        ParallelSurface as ParallelSurface,
        parallel_surface as parallel_surface,
    )

_PUBLIC = {
    "first_contact": ("BallContact", "Contacts"),
    "interference_points": ("interference_points",),
    "parallel_surface": ("ParallelSurface", "parallel_surface"),
}
doorway(__name__, _PUBLIC)
