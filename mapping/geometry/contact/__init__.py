"""Contact of a ball with a mesh: first contact, the parallel surface and its caustics."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.geometry.contact.first_contact import BallContact as BallContact, Contacts as Contacts

_PUBLIC = {
    "first_contact": ("BallContact", "Contacts"),
}
doorway(__name__, _PUBLIC)
