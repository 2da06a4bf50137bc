"""The running service from Python: look, move, hold a key, give all of it back. Start it first: `gantryctl serve`."""

from gantryctl.client import local_axis

with local_axis("hust_gantry") as axis:
    print(
        f"{axis.tags.machine} stands at {axis.tags.pos_act_deg:.2f} deg, power {'on' if axis.tags.power else 'off'}"
    )

    axis.take()
    axis.power_on()
    begin_deg = axis.tags.pos_ref_deg
    tags = axis.move_by(1.0, speed_deg_s=2.0)
    print(f"moved by {tags.pos_ref_deg - begin_deg:.2f} deg")

    # The loop is what holds the key: a loop that hangs lets it go, and leaving the block does.
    with axis.hold("reverse", speed_deg_s=1.0) as key:
        for tags in key:
            if tags.pos_ref_deg < begin_deg + 0.8:
                break
    print(f"key let go, at rest {axis.tags.pos_ref_deg - begin_deg:.2f} deg from the begin")

# Over the network the same axis comes from a login, and the certificate of the service is checked:
#     with Service("https://gantry.example:8650", "anna", password, certificate="cert.pem") as service:
#         with service.axis() as axis: ...
