"""What an unknown is: one file a block, their values, who shares them, and the gauge."""

import importlib
import pkgutil

# A block registers itself when its file is imported: a new file is found without naming it here.
for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_module.name}")
