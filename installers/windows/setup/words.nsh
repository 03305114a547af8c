; Texts of the installer in all languages. "$1" and "$2" are numbers.

LangString StudioDescription ${LANG_ENGLISH} "The window, the virtual robot and everything they need."
LangString StudioDescription ${LANG_SPANISH} "La ventana, el robot virtual y todo lo que necesitan."
LangString StudioDescription ${LANG_FRENCH} "La fenêtre, le robot virtuel et tout ce dont ils ont besoin."
LangString StudioDescription ${LANG_JAPANESE} "ウィンドウ、バーチャルロボットと、それらに必要なものすべて。"

LangString PathTitle ${LANG_ENGLISH} "The command nep in terminals"
LangString PathTitle ${LANG_SPANISH} "El comando nep en terminales"
LangString PathTitle ${LANG_FRENCH} "La commande nep dans les terminaux"
LangString PathTitle ${LANG_JAPANESE} "ターミナルのnepコマンド"

LangString PathDescription ${LANG_ENGLISH} "Adds NEP Studio's folder to your PATH."
LangString PathDescription ${LANG_SPANISH} "Agrega la carpeta de NEP Studio a tu PATH."
LangString PathDescription ${LANG_FRENCH} "Ajoute le dossier de NEP Studio à votre PATH."
LangString PathDescription ${LANG_JAPANESE} "NEP StudioのフォルダーをPATHに追加します。"

LangString StudioIsOpen ${LANG_ENGLISH} "NEP Studio is open. Save your work and close it, then try again. Nothing was changed."
LangString StudioIsOpen ${LANG_SPANISH} "NEP Studio está abierto. Guarda tu trabajo y ciérralo; después inténtalo otra vez. No se cambió nada."
LangString StudioIsOpen ${LANG_FRENCH} "NEP Studio est ouvert. Enregistrez votre travail et fermez-le, puis réessayez. Rien n’a été modifié."
LangString StudioIsOpen ${LANG_JAPANESE} "NEP Studioが開いています。作業を保存して閉じてから、もう一度実行してください。何も変更されていません。"

LangString SetupIsRunning ${LANG_ENGLISH} "Setup is already running. Look for its other window."
LangString SetupIsRunning ${LANG_SPANISH} "Este instalador ya está en marcha: busca su otra ventana."
LangString SetupIsRunning ${LANG_FRENCH} "L’installation est déjà en cours. Cherchez son autre fenêtre."
LangString SetupIsRunning ${LANG_JAPANESE} "セットアップはすでに実行中です。別のウィンドウを確認してください。"

LangString NotEnoughSpace ${LANG_ENGLISH} "There is not enough disk space: NEP Studio needs $2 MB, but only $1 MB are free. Free some space and try again."
LangString NotEnoughSpace ${LANG_SPANISH} "No hay suficiente espacio en el disco: NEP Studio necesita $2 MB y hay $1 MB libres. Libera espacio e inténtalo otra vez."
LangString NotEnoughSpace ${LANG_FRENCH} "Espace disque insuffisant : NEP Studio a besoin de $2 Mo et $1 Mo sont libres. Libérez de l’espace et réessayez."
LangString NotEnoughSpace ${LANG_JAPANESE} "ディスクの空き容量が足りません。NEP Studioには$2 MB必要ですが、空きは$1 MBです。空きを増やしてからもう一度実行してください。"

LangString NoFolder ${LANG_ENGLISH} "Setup can't write to this folder: $INSTDIR. Choose another one."
LangString NoFolder ${LANG_SPANISH} "No puedes escribir en esta carpeta: $INSTDIR. Elige otra."
LangString NoFolder ${LANG_FRENCH} "Impossible d’écrire dans ce dossier : $INSTDIR. Choisissez-en un autre."
LangString NoFolder ${LANG_JAPANESE} "このフォルダーには書き込めません: $INSTDIR。別のフォルダーを選んでください。"

LangString CannotReplace ${LANG_ENGLISH} "The files of the installed version can't be replaced because another program uses them. The installed version is unchanged. Close that program or restart the computer, then try again."
LangString CannotReplace ${LANG_SPANISH} "No se pueden reemplazar los archivos de la versión instalada: otro programa los usa. Esa versión queda como estaba. Cierra ese programa o reinicia la computadora; después inténtalo otra vez."
LangString CannotReplace ${LANG_FRENCH} "Impossible de remplacer les fichiers de la version installée : un autre programme les utilise. Cette version est inchangée. Fermez ce programme ou redémarrez l’ordinateur, puis réessayez."
LangString CannotReplace ${LANG_JAPANESE} "インストール済みのバージョンのファイルを別のプログラムが使っているため、置き換えられません。そのバージョンは元のままです。そのプログラムを閉じるかコンピューターを再起動してから、もう一度実行してください。"

LangString NotInstalled ${LANG_ENGLISH} "NEP Studio ${VERSION} was not installed. Any version installed before and your work are unchanged."
LangString NotInstalled ${LANG_SPANISH} "NEP Studio ${VERSION} no se instaló. Si ya había una versión, sigue igual, y tu trabajo también."
LangString NotInstalled ${LANG_FRENCH} "NEP Studio ${VERSION} n’a pas été installé. Une version déjà installée et votre travail sont inchangés."
LangString NotInstalled ${LANG_JAPANESE} "NEP Studio ${VERSION}はインストールされませんでした。以前のバージョンと作業内容はそのままです。"

LangString KeepUserData ${LANG_ENGLISH} "Keep your settings and the backups of behaviours that NEP Studio created?$\r$\n$\r$\nFiles that you saved yourself are kept in any case."
LangString KeepUserData ${LANG_SPANISH} "¿Conservar tus ajustes y las copias de comportamientos que NEP Studio guardó para ti?$\r$\n$\r$\nLos archivos que guardaste tú se quedan en cualquier caso."
LangString KeepUserData ${LANG_FRENCH} "Conserver vos paramètres et les copies de secours des comportements créées par NEP Studio ?$\r$\n$\r$\nLes fichiers que vous avez enregistrés vous-même restent dans tous les cas."
LangString KeepUserData ${LANG_JAPANESE} "設定と、NEP Studioが作成したふるまいのバックアップを残しますか？$\r$\n$\r$\n自分で保存したファイルは、どちらの場合も残ります。"
