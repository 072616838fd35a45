"""Reading a dataset, in whichever format it is."""

from pathlib import Path

from ..errors import InputError
from ..reading.regular import is_file
from ..reading.trees import read_json
from ..records.validation import validate
from .config import Config
from .contents import Store, Stored
from .folder_store import FolderStore
from .run import DATASET
from .shard_store import ShardStore


class Dataset:
    """The samples of a dataset's folder, by position; samples that failed are left out.

    Raises:
        InputError: the folder holds no dataset.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)
        if not is_file(self.folder / DATASET):
            raise InputError(
                f"holds no {DATASET}", str(folder), "give a folder that `mitsuba-endo dataset` made"
            )
        record = read_json(self.folder / DATASET, "make the dataset again")
        if not isinstance(record.get("config"), dict):
            where = str(self.folder / DATASET)
            raise InputError("holds no configuration", where, "make the dataset again")
        self.config = validate(Config, record["config"], DATASET)
        store: Store = FolderStore(self.folder)
        if self.config.format == "hdf5":
            store = ShardStore(self.folder, self.config.shard)
        self._store = store
        self.indices = sorted(store.indices())
        """Number of the sample at each position."""

    def __len__(self) -> int:
        return len(self.indices)

    def __getitem__(self, position: int) -> Stored:
        """Read a sample.

        Raises:
            InputError: it is damaged.
        """
        return self._store.read(self.indices[position])
