"""Missing physics where no model leaves only noise, as on most real robots: judged by whole windows.

In: a cleaned Campaign. Out: an Outcome: the terms that whole windows ask for, each with what stands for it as well.
A residual that is far above the noise is no noise: it counts for as few independent values as it has
(`independent_values`), and what a window leaves is compared with what the other windows leave.
"""
