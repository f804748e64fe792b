"""A master's data folder with thousands of jobs: rows of its jobs, copied in the store while the master is stopped."""
import os
import shutil
import sqlite3


def copy_jobs(data, copies):
    """`copies`: pairs of the id of a job that is there and the new row's columns, id included."""
    store = sqlite3.connect(data / "master.sqlite")
    try:
        names = [row[1] for row in store.execute("PRAGMA table_info(jobs)")]
        known = {}
        for template, columns in copies:
            if template not in known:
                known[template] = store.execute("SELECT * FROM jobs WHERE id = ?", (template,)).fetchone()
                assert known[template], template
            row = dict(zip(names, known[template]))
            row.update(token="", digest="", **columns)
            store.execute(f"INSERT INTO jobs VALUES ({','.join('?' * len(names))})", [row[n] for n in names])
            folder = data / "jobs" / template
            if folder.exists() and row["iterations"] > 0:
                shutil.copytree(folder, data / "jobs" / columns["id"], copy_function=os.link)
        store.commit()
    finally:
        store.close()
