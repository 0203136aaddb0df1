"""Runs in the Python interface, read from their directories on access."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mlsanm_cli.errors import RunError
from mlsanm_cli.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from mlsanm_cli.io.run_reader import RunData

    FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ContactState:
    """A contact at one position of the path; arrays (m,) along the slave surface.

    ``how`` is the origin of the values: "stored", the power "series" of a step, "linear" where a mean of
    stored states is exact, or "interpolated" with an estimated ``error`` of pressures over the peak.
    ``arc_length``, ``x`` and ``y`` are those of the undeformed surface; ``pressure`` is positive in
    compression; ``traction`` and ``slip`` are None without friction. ``force`` (2,) acts on the slave.
    """

    position: float
    how: str
    arc_length: FloatArray
    x: FloatArray
    y: FloatArray
    pressure: FloatArray
    gap: FloatArray
    traction: FloatArray | None
    slip: FloatArray | None
    force: FloatArray
    error: float = 0.0

    @property
    def peak_pressure(self) -> float:
        """The largest pressure; 0 for an open contact."""
        return float(self.pressure.max(initial=0.0))


@dataclass(frozen=True, eq=False)
class Contact:
    """One contact of a run."""

    run: Run
    name: str

    def at(self, position: float | None = None) -> ContactState:
        """The contact at a position of the path, by default its end: stored, from series, or interpolated.

        Raises RunError beyond the path and where no values are available.
        """
        from mlsanm_cli.app.results.probe import probe_contact, probe_force

        (row,) = probe_contact(self.run.data, _levels(position), self.name)
        (force,) = probe_force(self.run.data, _levels(position), self.name, contact=True)
        return ContactState(**{"traction": None, "slip": None, **row}, force=_force(force))


class Run:
    """The directory of a run that is done, failed, stopped or still running.

    Data are read once; `reload` reads a run again that has continued.
    """

    def __init__(self, directory: Path) -> None:
        """Open a run directory. Raises RunError if it holds no readable run."""
        self.directory = directory
        self.directory = self.data.directory

    def __repr__(self) -> str:
        return f"<Run {self.directory}: {self.status}>"

    def _repr_html_(self) -> str:
        """Status and figures as in a report, in notebooks."""
        from mlsanm_cli.app.results.report import main_figures

        return main_figures(self.data)

    @cached_property
    def data(self) -> RunData:
        """All arrays of run.h5, as `mlsanm_cli.io.run_reader` describes them."""
        from mlsanm_cli.io.run_reader import read_run

        return read_run(self.directory)

    def reload(self) -> Run:
        """The same run, read again."""
        return Run(self.directory)

    @property
    def status(self) -> str:
        """ "running" (or killed), "done", "failed" or "stopped"."""
        return self.data.status

    @cached_property
    def summary(self) -> Mapping[str, Any]:
        """Results, checks, times and provenance, as shown by ``mlsanm info``."""
        from mlsanm_cli.app.results.info import info

        return info(self.directory)

    @cached_property
    def case(self) -> Mapping[str, Any]:
        """The case with every default filled in, as nested dicts and lists."""
        import tomllib

        return tomllib.loads(self.data.case_resolved)

    @cached_property
    def path(self) -> dict[str, NDArray[Any]]:
        """The columns of ``path.csv`` as arrays by name, as for ``pandas.DataFrame(run.path)``."""
        from mlsanm_cli.io.run_reader import read_path

        return dict(read_path(self.directory))

    @property
    def contacts(self) -> tuple[str, ...]:
        """Names of the contacts."""
        return tuple(self.data.contacts)

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies."""
        return tuple(self.data.bodies)

    def contact(self, name: str | None = None) -> Contact:
        """A contact by name, or the only one. Raises RunError if there is none."""
        from mlsanm_cli.app.results.path_lookup import refuse_unknown

        if name is None and len(self.contacts) != 1:
            known = f"there are: {', '.join(self.contacts)}" if self.contacts else "there is none"
            raise RunError("the run does not have one contact", known)
        name = self.contacts[0] if name is None else name
        refuse_unknown(name, self.contacts, "contact")
        return Contact(self, name)

    def force(self, name: str, at: float | None = None) -> FloatArray:
        """Force (2,) of a load or support on its body, or of a contact on its slave. Raises RunError."""
        from mlsanm_cli.app.results.probe import probe_force

        (row,) = probe_force(self.data, _levels(at), name)
        return _force(row)

    def probe(self, name: str, at: float | None = None) -> dict[str, float]:
        """Values at a ``[[probe]]`` of the case: ux, uy, xx, yy, xy, von_mises. Raises RunError."""
        from mlsanm_cli.app.results.probe import probe_named

        return _values(probe_named(self.data, _levels(at), name))

    def point(self, body: str, x: float, y: float, at: float | None = None) -> dict[str, float]:
        """Displacement and stress at any point of a body, at a position with saved fields: ux, uy, xx, yy,
        xy, von_mises. Raises RunError for other points and positions."""
        from mlsanm_cli.app.results.probe import probe_point

        return _values(probe_point(self.data, _levels(at), body, (float(x), float(y))))

    def fields(self, body: str, at: float | None = None) -> dict[str, NDArray[Any]]:
        """Saved fields of a body: undeformed ``points`` (n, 2), ``triangles`` (t, 3), and by
        the names of ``output.fields`` displacement (n, 2), stress (n, 3) as xx, yy, xy, von_mises (n,).

        Raises RunError where no fields are saved.
        """
        from mlsanm_cli.app.results.fields import saved_state, triangles_of
        from mlsanm_cli.app.results.path_lookup import refuse_unknown

        refuse_unknown(body, self.bodies, "body")
        state, nodes = saved_state(self.data, at), self.data.bodies[body]
        return {"points": nodes.points, "triangles": triangles_of(nodes), **state.bodies[body]}

    def plot(
        self,
        what: str = "",
        *,
        contact: str | None = None,
        field: str | None = None,
        at: Sequence[float] = (),
        along: str | None = None,
        out: str | Path | None = None,
        animate: bool = False,
        formats: Sequence[str] = ("png",),
    ) -> list[Path]:
        """Draw the pictures of ``mlsanm plot`` into the run directory or ``out``; returns the files."""
        from mlsanm_cli.app.results.choice import Choice
        from mlsanm_cli.app.results.plot import plot

        file = None if out is None else Path(out)
        kinds, places = (what,) if what else (), tuple(map(float, at))
        choice = Choice(kinds, contact, field, places, along, file, animate)
        return plot(self.directory, formats=tuple(formats), choice=choice)


def _levels(at: float | None) -> list[float]:
    return [] if at is None else [float(at)]


def _values(rows: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    return {key: value for key, value in rows[0].items() if key not in ("position", "how", "error")}


def _force(row: Mapping[str, float]) -> FloatArray:
    import numpy as np

    return np.array([row["fx"], row["fy"]])
