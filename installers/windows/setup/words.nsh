; What the setup says, in each of its languages. Plain and short; "$1", "$2" are numbers.

LangString StudioDescription ${LANG_ENGLISH} "The window, the virtual robot and all that they need."
LangString StudioDescription ${LANG_SPANISH} "La ventana, el robot virtual y todo lo que necesitan."

LangString PathTitle ${LANG_ENGLISH} "The command nep, in terminals"
LangString PathTitle ${LANG_SPANISH} "El comando nep, en terminales"

LangString PathDescription ${LANG_ENGLISH} "For people who type commands: puts NEP Studio's folder on your PATH."
LangString PathDescription ${LANG_SPANISH} "Para quien escribe comandos: pone la carpeta de NEP Studio en tu PATH."

LangString StudioIsOpen ${LANG_ENGLISH} "NEP Studio is open. Save your work and close it, then try again. Nothing was changed."
LangString StudioIsOpen ${LANG_SPANISH} "NEP Studio está abierto. Guarda tu trabajo y ciérralo; después inténtalo otra vez. No se cambió nada."

LangString SetupRunsAlready ${LANG_ENGLISH} "This setup runs already: look for its other window."
LangString SetupRunsAlready ${LANG_SPANISH} "Este instalador ya está en marcha: busca su otra ventana."

LangString NoRoom ${LANG_ENGLISH} "There is not enough room on the disk: NEP Studio needs $2 MB, and $1 MB are free. Make room and try again."
LangString NoRoom ${LANG_SPANISH} "No hay suficiente espacio en el disco: NEP Studio necesita $2 MB y hay $1 MB libres. Libera espacio e inténtalo otra vez."

LangString NoFolder ${LANG_ENGLISH} "You may not write into this folder: $INSTDIR. Choose another one."
LangString NoFolder ${LANG_SPANISH} "No puedes escribir en esta carpeta: $INSTDIR. Elige otra."

LangString CannotReplace ${LANG_ENGLISH} "The files of the version that is there can't be replaced: another program uses them. That version stays as it was. Close it or restart the computer, then try again."
LangString CannotReplace ${LANG_SPANISH} "No se pueden reemplazar los archivos de la versión instalada: otro programa los usa. Esa versión queda como estaba. Ciérralo o reinicia la computadora; después inténtalo otra vez."

LangString NotInstalled ${LANG_ENGLISH} "NEP Studio ${VERSION} was not installed. A version that was there before is unchanged, and so is your work."
LangString NotInstalled ${LANG_SPANISH} "NEP Studio ${VERSION} no se instaló. Si ya había una versión, sigue igual, y tu trabajo también."

LangString KeepYourWork ${LANG_ENGLISH} "Keep your settings, and the copies of behaviours that NEP Studio has kept for you?$\r$\n$\r$\nFiles that you saved yourself stay in any case."
LangString KeepYourWork ${LANG_SPANISH} "¿Conservar tus ajustes y las copias de comportamientos que NEP Studio guardó para ti?$\r$\n$\r$\nLos archivos que guardaste tú se quedan en cualquier caso."
