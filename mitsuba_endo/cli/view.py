"""``mitsuba-endo view``: a result in a live 3D viewer."""

from .console import Debug, Json, Quiet, Session, session
from .options import HOST, PORT, Browser, Host, MaybeTruth, Port, Result


def view(
    result: Result,
    truth: MaybeTruth = None,
    port: Port = PORT,
    host: Host = HOST,
    browser: Browser = True,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Look at a result in 3D: iterations, rays, uncertainty, distances. Ends with Ctrl-C."""
    with session(quiet, as_json, debug) as output:
        from ..show.read_folder import read_solution_folder
        from ..show.truth import find_truth, read_truth
        from ..show.viewer import open_viewer, running_server, wait_for_interrupt

        calibration = read_solution_folder(result)
        if truth is not None:
            read_truth(truth, calibration.solution)  # refused before a browser opens
        truth_path = truth or find_truth(result, calibration.solution)
        with running_server(host, port) as server:
            viewer = open_viewer(server, calibration, truth_path)
            announce(server, browser, output)
            output.summary({"address": address_of(server), "truth": truth_path and str(truth_path)})
            if viewer.comparison is not None:
                viewer.comparison.join()
            for fault in viewer.faults or ():
                if truth is not None:
                    raise fault
                output.print(f"The truth is left out: {fault}")
            wait_for_interrupt()


def address_of(server: object) -> str:
    """Return the address that a browser needs."""
    from ..show.viewer import address

    return address(server)


def announce(server: object, browser: bool, output: Session) -> None:
    """Say where the viewer is, and open a browser there if asked to."""
    import sys
    import webbrowser

    output.print(f"{address_of(server)}: the viewer; it ends with Ctrl-C.")
    sys.stdout.flush()  # a pipe would keep it until the end
    if browser:
        webbrowser.open(address_of(server))
