# %% [markdown]
# # Stick and slip under a tangential force
#
# The case `cattaneo_mindlin` presses a cylinder on a block, then shears it below the limit of friction.
# The centre sticks and the ends slip: $c / a = \sqrt{1 - Q / (\mu P)}$ (Cattaneo 1938, Mindlin 1949).

# %%
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import mlsanm_cli as mlsanm

here = Path.cwd()
cases = next(p / "cases" for p in (here, *here.parents) if (p / "cases").is_dir())
run = mlsanm.run(cases / "cattaneo_mindlin.toml", out="results/notebook_partial_slip", force=True)
state = run.contact().at(run.summary["position"])

# %%

fig, ax = plt.subplots()
ax.plot(state.x, state.pressure, label="pressure")
ax.plot(state.x, np.abs(state.traction), label="|traction|")
ax.set(xlabel="x", ylabel="stress")
closed = state.x[state.pressure > 0.0]
ax.set_xlim(1.3 * closed.min(), 1.3 * closed.max())
ax.legend()

# %%
path = run.path
plt.plot(path["position"], path[next(key for key in path if key.endswith("peak_pressure"))])
plt.gca().set(xlabel="position on the load path", ylabel="peak pressure")
