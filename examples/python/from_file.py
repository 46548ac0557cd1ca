"""A flow that starts from disks in a table: columns x, y, diameter."""
import numpy as np

import pliant

container, sizes = pliant.Container(5, 15), pliant.diameters(200)
np.savetxt("disks.csv", np.column_stack([container.pack(sizes), sizes]), delimiter=",", header="x,y,diameter", comments="")

run = pliant.hopper(start="disks.csv", hopper_width=5, hopper_wall_distance=15, zeta=0.3, t_end=30, output="from-file")
print("Q =", run.measured("Q"))
