"""The page in a browser: the team as it drives, to look at and to touch (`lfa web`).

`picture.py` turns messages into frames; an engine (`virtual.py`, `fleet.py`) feeds it and obeys orders; `server.py`
hands both to browsers; `page/` holds what runs there.
"""
