"""During a session: does the model hold so far, and which window would tell most? In processes of their own."""
