"""Identified parameters as other programs want them: URDF inertial, MJCF, a Python snippet, TOML.

Identification finds s′ and I′ (about P, per unit mass). URDF and MJCF want a mass, the centre of mass and the inertia
about it in kg m²; the mass comes from `--mass` or from `identify --payload`.
"""

from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

import numpy as np
import tomli_w

from fidim_lab.data.records import PARAMETER_NAMES, Body
from fidim_lab.errors import InfeasibleError, SetupError
from fidim_lab.identification.results.result_file import ParameterTable, ResultTable

_LINK = "platform"


@dataclass(frozen=True, eq=False)
class MassiveBody:
    """A rigid body with its mass."""

    mass: float
    """kg"""
    com: np.ndarray
    """(3,) m, body frame, from P"""
    inertia: np.ndarray
    """(3, 3) kg m² about the centre of mass, body frame"""


def massive_body(body: Body, mass: float) -> MassiveBody:
    """The body with a mass (kg): I = m I′ about G. Raises InfeasibleError for an inertia that no rigid body has."""
    inertia = mass * body.inertia_about_com
    moments = np.linalg.eigvalsh(inertia)
    if moments[0] <= 0.0 or moments[0] + moments[1] < moments[2] * (1.0 - 1e-9):
        raise InfeasibleError(
            f"The principal moments about the centre of mass are {', '.join(f'{m:.4g}' for m in moments)} kg m²; "
            "no rigid body has them (each must be above 0 and at most the sum of the other two).",
            hint="Some parameters are badly determined: see their sd, and fidim design for a better experiment.",
        )
    return MassiveBody(mass, np.array(body.com), inertia)


def mass_of(result: ResultTable, given: float | None) -> float:
    """kg, the given one or what a payload showed. Raises SetupError where nobody knows it."""
    if given is not None:
        return given
    if result.mass is None:
        raise SetupError("Free motion does not determine the mass, and this result has none.", hint="Give --mass KG.")
    return result.mass.value


def urdf(result: ResultTable, mass: float) -> str:
    """A robot of one link with its inertial element, body frame at P."""
    body = massive_body(result.body, mass)
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = body.inertia.tolist()
    inertia = {"ixx": xx, "ixy": xy, "ixz": xz, "iyy": yy, "iyz": yz, "izz": zz}
    entries = " ".join(f'{name}="{_number(value)}"' for name, value in inertia.items())
    return (
        '<?xml version="1.0"?>\n'
        f"<!-- {_origin(result)} -->\n"
        f'<robot name={quoteattr(_LINK)}>\n  <link name="{_LINK}">\n    <inertial>\n'
        f'      <origin xyz="{_numbers(body.com)}" rpy="0 0 0"/>\n'
        f'      <mass value="{_number(body.mass)}"/>\n'
        f"      <inertia {entries}/>\n"
        "    </inertial>\n  </link>\n</robot>\n"
    )


def mjcf(result: ResultTable, mass: float) -> str:
    """A MuJoCo model of the free body, body frame at P."""
    body = massive_body(result.body, mass)
    i = body.inertia
    full = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
    return (
        f"<!-- {_origin(result)} -->\n"
        f'<mujoco model="{_LINK}">\n  <worldbody>\n    <body name="{_LINK}">\n      <freejoint/>\n'
        f'      <inertial pos="{_numbers(body.com)}" mass="{_number(body.mass)}" fullinertia="{_numbers(full)}"/>\n'
        "    </body>\n  </worldbody>\n</mujoco>\n"
    )


def python_snippet(result: ResultTable, mass: float | None) -> str:
    """Code that defines s and I (about P, per unit mass), and with a mass the inertia about the centre of mass."""
    body = result.body
    rows = ",\n              ".join(f"[{', '.join(_number(v) for v in row)}]" for row in body.inertia_matrix.tolist())
    text = (
        f"# {_origin(result)}\n"
        "import numpy as np\n\n"
        f"s = np.array([{', '.join(_number(v) for v in body.com)}])  # m, centre of mass from P, body frame\n"
        f"I = np.array([{rows}])  # m^2, inertia about P per unit mass\n"
        f"sd = {{{', '.join(f'{name!r}: {parameter.sd!r}' for name, parameter in _parameters(result))}}}\n"
        "I_com = I - (s @ s * np.eye(3) - np.outer(s, s))  # m^2, about the centre of mass\n"
    )
    return text if mass is None else f"{text}mass = {_number(mass)}  # kg\nJ = mass * I_com  # kg m^2\n"


def toml(result: ResultTable, mass: float | None) -> str:
    """Value, sd and nominal value of each parameter."""
    parameters = {
        name: {key: value for key, value in parameter.model_dump().items() if value is not None}
        for name, parameter in _parameters(result)
    }
    table: dict[str, object] = {"campaign": result.campaign, "method": result.method, "outcome": result.outcome}
    if mass is not None:
        table["mass"] = mass
    return f"# {_origin(result)}\n" + tomli_w.dumps({**table, "parameters": parameters})


def _parameters(result: ResultTable) -> list[tuple[str, ParameterTable]]:
    return [(name, result.parameters[name]) for name in PARAMETER_NAMES]


def _origin(result: ResultTable) -> str:
    name = result.campaign.replace("--", "- -").replace("\n", " ")
    return f"Identified by fidim-lab from campaign {name} (method {result.method}): {result.outcome}. Body frame at P."


def _number(value: float) -> str:
    return f"{value:.12g}"


def _numbers(values: "np.ndarray | list[float]") -> str:
    return " ".join(_number(float(value)) for value in values)
