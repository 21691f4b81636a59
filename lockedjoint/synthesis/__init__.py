"""From a Jacobian to manipulators: axes, orders, Denavit–Hartenberg, URDF.

A column of J fixes a joint's axis relative to the end effector, so a Jacobian is a set of axes;
a manipulator is a set of axes in an order. `from_jacobian` finds the axes, `family` lists the
orders, `choice` picks one by a criterion, and `dh` and `write_urdf` write it down.
"""
