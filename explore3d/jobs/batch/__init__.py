"""Batch: many logs, each on its own, into one store of Parquet; at home on a machine's cores or on a cluster."""

from typing import TYPE_CHECKING

from mapping.doorway import doorway

if TYPE_CHECKING:
    from explore3d.jobs.batch.batch import Batch as Batch, Standing as Standing, batch as batch
    from explore3d.jobs.batch.from_afar import FarLog as FarLog, inspect_at as inspect_at
    from explore3d.jobs.batch.rehearsal import rehearse as rehearse
    from explore3d.jobs.batch.store import RUN_COLUMNS as RUN_COLUMNS, STATUSES as STATUSES, Store as Store
    from explore3d.jobs.batch.tasks import Task as Task, tasks_of as tasks_of
    from explore3d.jobs.batch.worker import Limits as Limits

_PUBLIC = {
    "batch": ("Batch", "Standing", "batch"),
    "from_afar": ("FarLog", "inspect_at"),
    "rehearsal": ("rehearse",),
    "store": ("RUN_COLUMNS", "STATUSES", "Store"),
    "tasks": ("Task", "tasks_of"),
    "worker": ("Limits",),
}
doorway(__name__, _PUBLIC)
