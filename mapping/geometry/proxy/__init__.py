"""Proxy: a ball that stays outside of a body while the hand that leads it may not, and so says what force it feels."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from mapping.geometry.proxy.body import ProxyBody as ProxyBody
    from mapping.geometry.proxy.parts import (
        Bar as Bar,
        Bell as Bell,
        Chain as Chain,
        Part as Part,
        Swell as Swell,
        Terrace as Terrace,
        Trench as Trench,
    )
    from mapping.geometry.proxy.proxy import (
        Followed as Followed,
        Proxy as Proxy,
        free_place as free_place,
        pressed_along as pressed_along,
    )
    from mapping.geometry.proxy.proxy_kernels import proxy_step as proxy_step, workspace as workspace

_PUBLIC = {
    "body": ("ProxyBody",),
    "parts": ("Bar", "Bell", "Chain", "Part", "Swell", "Terrace", "Trench"),
    "proxy": ("Followed", "Proxy", "free_place", "pressed_along"),
    "proxy_kernels": ("proxy_step", "workspace"),
}
doorway(__name__, _PUBLIC)
