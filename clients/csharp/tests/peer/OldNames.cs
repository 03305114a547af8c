using System;
using System.Collections.Generic;
using System.Threading;
using Nep;

/// <summary>Program with the names of the original library 0.0.0.5: answers each message of the topic "ask".</summary>
internal static class OldNames
{
    private static void Main()
    {
        using (var node = new NepNode("old_names"))
        {
            NepConfiguration configuration = node.Hybrid();
            NepPublisher publisher = node.NewPub("answer", "json", configuration);
            NepSubscriber subscriber = node.NewSub("ask", "json");
            node.NewCallback("called", json => publisher.SendString(json));
            Console.WriteLine("ready");
            string text;
            bool isOver = false;
            while (!isOver)
            {
                node.Update();
                if (subscriber.Listen(out text))
                {
                    publisher.Publish(new Dictionary<string, string> { { "heard", text } });
                    publisher.Publish(new NepGeometryMsgs.NepTwist { linear = new NepGeometryMsgs.NepVector3 { x = 0.5 } });
                    publisher.Publish(new NepSensorMsgs.Range { max_range = 4, header = new NepSensorMsgs.Header { frame_id = "front" } });
                    isOver = text.Contains("end");
                }
                Thread.Sleep(1);
            }
            node.Close();
        }
    }
}
