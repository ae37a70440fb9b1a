"""LAS and LAZ: points of a scanner, kept as whole numbers on a grid."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from explore3d import UserError
from explore3d.log.own import Log
from explore3d.log.readers.arrays import numbers_log
from explore3d.log.readers.clouds import ORDER
from explore3d.log.readers.optional import claimed, decoding, library
from explore3d.log.readers.own import POINT, TIP


class LasPoints:
    """Points in the order of the file, or of their times; each source (flight line) is a sweep."""

    name = "a LAS or LAZ file"
    unsaid: tuple[str, ...] = ("the units", ORDER, TIP, POINT)

    def sniff(self, first: bytes) -> float:
        return 1.0 if first.startswith(b"LASF") else 0.0

    def read(self, path: Path, settings: Mapping[str, Any]) -> Log:
        laspy = library(path, "laspy", "formats", self.name)
        with decoding(path, self.name):
            with laspy.open(path) as file:
                header = file.header
                size = header.point_count * header.point_format.size
                if not header.are_points_compressed and header.offset_to_point_data + size > path.stat().st_size:
                    raise UserError(
                        f"{path}: its header claims {header.point_count:,} points, for which its "
                        f"{path.stat().st_size:,} bytes are too few; it is cut"
                    )
                claimed(path, self.name, size)
                if not np.isfinite([*header.scales, *header.offsets]).all() or not (header.scales > 0).all():
                    raise UserError(f"{path}: its header states a grid of {header.scales}, which is none")
                las = file.read()
            names, columns = ["x", "y", "z"], [np.asarray(las[axis], dtype=np.float64) for axis in ("x", "y", "z")]
            dimensions = set(header.point_format.dimension_names)
            if "gps_time" in dimensions and np.ptp(np.asarray(las["gps_time"])) > 0:
                names.append("t")
                columns.append(np.asarray(las["gps_time"], dtype=np.float64))
            if np.ptp(np.asarray(las["point_source_id"]).astype(np.int64)) > 0:
                names.append("sweep")
                columns.append(np.asarray(las["point_source_id"], dtype=np.float64))
        step = float(np.max(header.scales))
        said = [f"positions lie on a grid of {step:g} of their unit, for LAS keeps whole numbers"]
        return numbers_log(path, names, np.column_stack(columns), settings, self.name, said, step)
