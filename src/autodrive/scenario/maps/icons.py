"""Faces of the traffic signs as SVG, for top-view drawings and for the textures of the signs."""

from __future__ import annotations

from autodrive.scenario.maps.props import PropKind

RED, BLUE, YELLOW, WHITE, BLACK = "#d0211c", "#1657a8", "#ffc51f", "#ffffff", "#1d1d1f"

_OCTAGON = "M-.5 -.207 L-.207 -.5 H.207 L.5 -.207 V.207 L.207 .5 H-.207 L-.5 .207 Z"
_DIAMOND = (
    f'<path d="M0 -.5 L.5 0 L0 .5 L-.5 0 Z" fill="{BLACK}"/><path d="M0 -.45 L.45 0 L0 .45 L-.45 0 Z" fill="{YELLOW}"/>'
)
_SQUARE = f'<rect x="-.45" y="-.45" width=".9" height=".9" rx=".09" fill="{BLUE}" stroke="{WHITE}" stroke-width=".05"/>'
_CURVE = (
    f'<path d="M.1 -.26 V-.02 A.15 .15 0 0 1 -.05 .13 H-.1" fill="none" stroke="{BLACK}" stroke-width=".1"/>'
    f'<path d="M-.09 .27 L-.27 .13 L-.09 -.01 Z" fill="{BLACK}"/>'
)
_SIDE_ROAD = f'<path d="M.06 -.28 V.28 M.06 .02 H-.24" fill="none" stroke="{BLACK}" stroke-width=".11"/>'
_MIRROR = '<g transform="scale(-1 1)">{}</g>'

_FACES: dict[PropKind, str] = {
    "stop": (
        f'<path d="{_OCTAGON}" fill="{WHITE}"/><path d="{_OCTAGON}" fill="{RED}" transform="scale(.9)"/>'
        f'<path d="M-.21 .11 H-.35 V0 H-.21 V-.11 H-.35 M-.17 .11 H.01 M-.08 .11 V-.11 M.05 .11 H.17 V-.11 H.05 Z '
        f'M.22 -.135 V.11 H.35 V0 H.22" fill="none" stroke="{WHITE}" stroke-width=".05"/>'
    ),
    "give_way": (f'<path d="M0 -.5 L.5 .4 H-.5 Z" fill="{RED}"/><path d="M0 -.26 L.29 .28 H-.29 Z" fill="{WHITE}"/>'),
    "dead_end": (
        f'{_SQUARE}<rect x="-.07" y="-.33" width=".14" height=".45" fill="{WHITE}"/>'
        f'<rect x="-.28" y=".1" width=".56" height=".16" fill="{RED}" stroke="{WHITE}" stroke-width=".03"/>'
    ),
    "parking": (
        f'{_SQUARE}<path d="M-.13 -.3 V.25 H.02 A.14 .14 0 0 0 .02 -.03 H-.13" '
        f'fill="none" stroke="{WHITE}" stroke-width=".12"/>'
    ),
    "no_parking": (
        f'<circle r=".42" fill="{BLUE}" stroke="{RED}" stroke-width=".12"/>'
        f'<path d="M-.3 .3 L.3 -.3" stroke="{RED}" stroke-width=".11"/>'
    ),
    "left_curve": _DIAMOND + _CURVE,
    "right_curve": _DIAMOND + _MIRROR.format(_CURVE),
    "side_road_left": _DIAMOND + _SIDE_ROAD,
    "side_road_right": _DIAMOND + _MIRROR.format(_SIDE_ROAD),
    "traffic_light": (
        f'<rect x="-.2" y="-.5" width=".4" height="1" rx=".12" fill="{BLACK}"/>'
        '<circle cy=".29" r=".13" fill="#ff4136"/><circle r=".13" fill="#ffb700"/>'
        '<circle cy="-.29" r=".13" fill="#2ecc40"/>'
    ),
}


def icon(kind: PropKind) -> str:
    """SVG elements in a square from (-0.5, -0.5) to (0.5, 0.5), y UP, as its driver sees the sign."""
    return _FACES[kind]
