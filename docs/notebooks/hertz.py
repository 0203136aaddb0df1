# %% [markdown]
# # Reading a Hertz contact
#
# A half-cylinder of radius 1 is pressed on a block. The run is compared with Hertz' line contact:
# half-width $a$ and peak pressure $p_0$ follow from the force $P$ per thickness, $a^2 = 4 P R / (\pi E^*)$,
# $p_0 = 2 P / (\pi a)$.

# %%
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import mlsanm_cli as mlsanm

here = Path.cwd()
cases = next(p / "cases" for p in (here, *here.parents) if (p / "cases").is_dir())
run = mlsanm.run(cases / "hertz.toml", out="results/notebook_hertz", force=True)
print(run.status, run.summary["contacts"]["interface"])

# %% [markdown]
# Pressures at any load: states between stored ones are solved, not interpolated.

# %%
fig, ax = plt.subplots()
for load in (0.25, 0.5, 1.0):
    state = run.contact().at(load)
    ax.plot(state.x, state.pressure, label=f"{100 * load:.0f} % of the load")
ax.set(xlim=(-0.1, 0.1), xlabel="x", ylabel="contact pressure")
ax.legend()

# %%
state = run.contact().at(1.0)
force = abs(state.force[1])
half = 2.0 * force / (np.pi * state.peak_pressure)
print(f"force {force:.6g}, peak pressure {state.peak_pressure:.6g}, half-width by Hertz {half:.5g}")
print("pressure error:", run.summary["contacts"]["interface"]["reference"])
