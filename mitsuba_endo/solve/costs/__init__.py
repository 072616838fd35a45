"""What costs: one file a term, the robust loss, and what puts terms together."""

import importlib
import pkgutil

# A prior registers itself when its file is imported: a new file is found without naming it here.
for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_module.name}")
