"""From a raw scan, rock and ground in one open mesh, to a closed rock and the ground beneath it."""
